/// Messages on their way from the bus to the disk. Unlimited in number, bounded in memory: what does not fit is counted
/// per channel, never dropped in silence. One thread pushes, one pops.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace roadfix {

struct QueuedMessage {
  std::string channel;
  int64_t received_us = 0;
  std::vector<uint8_t> data;
};

class MessageQueue {
 public:
  explicit MessageQueue(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  /// False where the message did not fit; it is counted.
  bool push(const std::string& channel, int64_t received_us, std::span<const uint8_t> data);

  /// The oldest message, waiting for one up to `timeout`.
  std::optional<QueuedMessage> pop(std::chrono::milliseconds timeout);

  [[nodiscard]] std::map<std::string, int64_t> dropped() const;
  [[nodiscard]] std::size_t bytes() const;
  [[nodiscard]] std::size_t size() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<QueuedMessage> messages_;
  std::map<std::string, int64_t> dropped_;
  std::size_t max_bytes_;
  std::size_t bytes_ = 0;
};

}  // namespace roadfix
