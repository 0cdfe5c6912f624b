/// A device over its unpluggings: opened, read, lost, opened again with growing pauses. Says what is the matter.
#pragma once

#include <functional>
#include <optional>

#include "drivers/device/byte_source.h"

namespace roadfix {

class DeviceSession {
 public:
  using Clock = std::chrono::steady_clock;
  using Open = std::function<std::unique_ptr<ByteSource>()>;

  DeviceSession(Open open, const DeviceConfig& config) : open_(std::move(open)), config_(config) {}

  /// Opens what is due, or reads for up to `timeout`. True where the device was opened by this call: what comes now
  /// does not continue what came before.
  bool step(Clock::time_point now, std::chrono::milliseconds timeout, std::vector<Packet>& packets);

  /// A file that is over.
  [[nodiscard]] bool ended() const { return ended_; }
  /// As text, empty where bytes come.
  [[nodiscard]] std::string state_reason(Clock::time_point now) const;
  [[nodiscard]] ByteSource* source() { return source_.get(); }
  [[nodiscard]] std::string name() const { return source_ ? source_->name() : config_.device; }
  [[nodiscard]] int64_t openings() const { return openings_; }

 private:
  bool open(Clock::time_point now);
  void disconnect(Clock::time_point now, const std::string& why);

  Open open_;
  DeviceConfig config_;
  std::unique_ptr<ByteSource> source_;
  std::optional<Clock::time_point> due_;  ///< of the next attempt to open
  Clock::time_point last_data_{};
  std::chrono::duration<double> pause_{0.0};
  std::string reason_;
  bool ended_ = false;
  int64_t openings_ = 0;
};

}  // namespace roadfix
