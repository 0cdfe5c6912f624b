/// One recording on a thread of its own, fed by a queue: the bus never waits for the disk.
#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "bus/bus.h"
#include "recorder/message_queue.h"
#include "recorder/recording.h"

namespace roadfix {

class RecordingThread {
 public:
  /// Throws what Recording throws.
  RecordingThread(const RecorderConfig& config, const std::string& name);
  ~RecordingThread() { finish(); }
  RecordingThread(const RecordingThread&) = delete;
  RecordingThread& operator=(const RecordingThread&) = delete;

  void push(const BusMessage& message);
  /// Waits until everything queued is on the disk.
  void finish();

  /// Why nothing is recorded; absent while it is.
  [[nodiscard]] std::optional<std::string> stopped() const;
  [[nodiscard]] const MessageQueue& queue() const { return queue_; }
  [[nodiscard]] const std::string& name() const { return recording_.name(); }
  /// Only after finish().
  [[nodiscard]] const Recording& recording() const { return recording_; }

 private:
  void work();
  void look(int64_t now_us);

  MessageQueue queue_;
  Recording recording_;
  int64_t tried_us_ = 0;
  mutable std::mutex mutex_;
  std::optional<std::string> stopped_;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

}  // namespace roadfix
