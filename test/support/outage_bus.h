/// A bus of memory with a network that can be gone: what is published then is counted and reaches nobody.
#pragma once

#include <string>
#include <vector>

#include "bus/transport/memory_bus.h"
#include "bus/types/message.h"

namespace roadfix::test {

class OutageBus : public MemoryBus {
 public:
  void publish(const std::string& channel, std::span<const uint8_t> bytes) override {
    if (gone) {
      ++unsent_;
    } else {
      MemoryBus::publish(channel, bytes);
    }
  }
  [[nodiscard]] int64_t unsent() const override { return unsent_; }

  bool gone = false;

 private:
  int64_t unsent_ = 0;
};

/// The last message of a channel that comes out of a bus while `work` runs.
template <class Message, class Work>
Message last_of(Bus& bus, const std::string& channel, const Work& work) {
  Message last{};
  bus.subscribe(channel, [&last](const BusMessage& m) { last = decode<Message>(m.bytes); });
  work();
  bus.handle(std::chrono::milliseconds(0));
  return last;
}

}  // namespace roadfix::test
