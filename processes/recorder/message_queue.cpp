#include "recorder/message_queue.h"

#include <utility>

namespace roadfix {

bool MessageQueue::push(const std::string& channel, int64_t received_us, std::span<const uint8_t> data) {
  QueuedMessage message{channel, received_us, {data.begin(), data.end()}};
  {
    const std::lock_guard lock(mutex_);
    if (bytes_ + data.size() > max_bytes_) {
      ++dropped_[channel];
      return false;
    }
    bytes_ += data.size();
    messages_.push_back(std::move(message));
  }
  arrived_.notify_one();
  return true;
}

std::optional<QueuedMessage> MessageQueue::pop(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  if (!arrived_.wait_for(lock, timeout, [&] { return !messages_.empty(); })) return std::nullopt;
  QueuedMessage message = std::move(messages_.front());
  messages_.pop_front();
  bytes_ -= message.data.size();
  return message;
}

std::map<std::string, int64_t> MessageQueue::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

std::size_t MessageQueue::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

std::size_t MessageQueue::size() const {
  const std::lock_guard lock(mutex_);
  return messages_.size();
}

}  // namespace roadfix
