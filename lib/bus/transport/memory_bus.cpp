#include "bus/transport/memory_bus.h"

namespace roadfix {

void MemoryBus::subscribe(const std::string& channels, Handler handler, const QueuePolicy&) {
  subscriptions_.push_back({std::regex(channels), std::move(handler)});
}

void MemoryBus::publish(const std::string& channel, std::span<const uint8_t> bytes) {
  sent_.push_back({channel, {bytes.begin(), bytes.end()}});
}

bool MemoryBus::handle(std::chrono::milliseconds) {
  if (sent_.empty()) return false;
  while (!sent_.empty()) {
    const Sent message = std::move(sent_.front());
    sent_.pop_front();
    for (const Subscription& subscription : subscriptions_) {
      if (std::regex_match(message.channel, subscription.channels)) {
        subscription.handler({message.channel, message.bytes, 0});
      }
    }
  }
  return true;
}

std::vector<QueueStatus> MemoryBus::queues() const {
  std::vector<QueueStatus> all(subscriptions_.size());
  for (const Sent& message : sent_) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i].depth += std::regex_match(message.channel, subscriptions_[i].channels) ? 1 : 0;
    }
  }
  return all;
}

}  // namespace roadfix
