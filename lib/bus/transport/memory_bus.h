/// A bus inside one process: what is published is handed out by the next handle(), in order, to every subscriber.
#pragma once

#include <deque>
#include <regex>

#include "bus/bus.h"

namespace roadfix {

class MemoryBus : public Bus {
 public:
  void subscribe(const std::string& channels, Handler handler, const QueuePolicy& policy = {}) override;
  void publish(const std::string& channel, std::span<const uint8_t> bytes) override;
  /// Never waits; false where nothing was there.
  bool handle(std::chrono::milliseconds timeout) override;
  [[nodiscard]] std::vector<QueueStatus> queues() const override;

 private:
  struct Subscription {
    std::regex channels;
    Handler handler;
  };
  struct Sent {
    std::string channel;
    std::vector<uint8_t> bytes;
  };
  std::vector<Subscription> subscriptions_;
  std::deque<Sent> sent_;
};

}  // namespace roadfix
