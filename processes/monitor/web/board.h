/// What the monitor's thread pins up and the web server's thread reads. The monitor never waits for a client: it swaps
/// a pointer under a lock that nobody holds for longer than that.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "monitor/web/history.h"
#include "monitor/web/picture.h"

namespace roadfix {

class Board {
 public:
  using Text = std::shared_ptr<const std::string>;
  using Picture = std::shared_ptr<const std::vector<uint8_t>>;  ///< an encoded, checked image_t

  /// `name`: what is looked at. `keep_frames`: a log: every frame stays, so that a page can go back and forth.
  Board(const std::string& name, bool keep_frames) : name_(name), keep_frames_(keep_frames) {}

  // The monitor's side.
  void put_frame(std::string json);
  void put_picture(int64_t utime, Picture picture);
  /// A log's pictures are read again when they are asked for.
  void put_picture(int64_t utime, std::function<Picture()> fetch);
  void set_done(double share) { done_ = share; }
  /// Whether anybody looks: without, no frame needs to be made.
  [[nodiscard]] bool watched() const { return keep_frames_ || clients_ > 0; }
  [[nodiscard]] History& history() { return history_; }

  // The server's side.
  void set_clients(int clients) { clients_ = clients; }
  /// Counts up with every frame; 0: none yet.
  [[nodiscard]] int64_t frame_number() const { return frame_number_; }
  [[nodiscard]] Text frame() const;
  /// A JSON array of kept frames.
  [[nodiscard]] std::string frames(std::size_t from, std::size_t count) const;
  /// The picture of this moment, or else the newest before it.
  [[nodiscard]] std::optional<WebPicture> picture(int64_t utime) const;
  [[nodiscard]] std::string about() const;
  [[nodiscard]] Text history_json();

 private:
  static constexpr std::size_t kRecentPictures = 16;
  static constexpr std::size_t kMostFrames = 36'000;  ///< two hours at 5 a second, some 200 MB

  struct Pinned {
    int64_t utime = 0;
    std::function<Picture()> fetch;
  };

  std::string name_;
  bool keep_frames_;
  std::atomic<int> clients_ = 0;
  std::atomic<int64_t> frame_number_ = 0;
  std::atomic<double> done_ = 0.0;
  mutable std::mutex mutex_;
  Text frame_;
  std::vector<Text> frames_;
  std::size_t keep_every_ = 1;
  std::deque<Pinned> pictures_;
  History history_;
  Text history_json_;
  std::size_t history_size_ = 0;
};

}  // namespace roadfix
