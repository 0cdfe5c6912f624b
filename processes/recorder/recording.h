/// One recording: a series of LCM logs NAME.000.lcm, NAME.001.lcm ... split by size and time, and a sidecar NAME.json
/// with the type definitions, their fingerprints, versions, and what each file holds. Plain LCM tools read the logs.
///
/// The receive times come with the messages; the disk's state is asked for at each split and each flush.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bus/log/log_writer.h"
#include "recorder/recorder_config.h"

namespace roadfix {

/// Free bytes of the disk that holds a folder; a test hands in its own.
using FreeSpace = std::function<uint64_t(const std::filesystem::path&)>;
uint64_t free_space(const std::filesystem::path& folder);

class Recording {
 public:
  enum class State { kRecording, kStopped };

  /// Makes the folder; throws LogError where that or the first file fails. `name` is usually the start's UTC time;
  /// where there is a recording of that name, this one's ends in -2, -3 ...
  Recording(const RecorderConfig& config, const std::string& name, FreeSpace free = free_space);
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  /// Appends to the current file or, once stopped, only counts. A failing disk stops the recording; it never throws.
  void write(const std::string& channel, int64_t received_us, std::span<const uint8_t> data);

  /// What was written is on the disk; splits and stops as the configuration says.
  void flush(int64_t now_us);

  /// Once stopped: goes on in a new file where the disk has room again. Whether it records.
  bool try_again();

  /// Closes the current file and begins the next; no message is lost.
  void split();

  /// Tells the sidecar what never reached the disk, per channel.
  void note_dropped(const std::map<std::string, int64_t>& dropped) { dropped_ = dropped; }

  /// Everything on disk, sidecar last.
  void close();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] const std::string& reason() const { return reason_; }  ///< why it stopped
  [[nodiscard]] int64_t unwritten() const { return unwritten_; }       ///< messages that came after the stop
  /// That are there: what when_full: delete_oldest took is forgotten, so that a drive may last for ever.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const { return files_; }
  [[nodiscard]] int64_t files_begun() const { return files_begun_; }

 private:
  struct FileFacts {
    std::string name;
    int64_t first_us = 0;
    int64_t last_us = 0;
    std::map<std::string, int64_t> events;
    uint64_t bytes = 0;
    uint64_t hash = 0;
  };

  void open_next();
  void finish_file();
  void stop(const std::string& reason);
  [[nodiscard]] std::string lack_of_space() const;
  void check_space();
  bool delete_oldest();
  void forget(const std::filesystem::path& file);
  [[nodiscard]] uint64_t recorded_bytes() const;
  void write_sidecar() const;

  RecorderConfig config_;
  std::filesystem::path folder_;
  std::string name_;
  FreeSpace free_;
  std::unique_ptr<LogWriter> log_;
  std::vector<std::filesystem::path> files_;
  std::vector<FileFacts> facts_;  ///< of each of files_
  int64_t files_begun_ = 0;
  std::map<std::string, int64_t> dropped_;
  State state_ = State::kRecording;
  std::string reason_;
  std::string earlier_reason_;  ///< of an interruption that is over
  int64_t unwritten_ = 0;
  int64_t flushed_us_ = 0;
};

}  // namespace roadfix
