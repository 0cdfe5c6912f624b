#include "recorder/message_queue.h"

#include <catch2/catch.hpp>
#include <thread>

namespace roadfix {
namespace {

using std::chrono::milliseconds;

TEST_CASE("messages come out in their order, and what does not fit is counted by channel") {
  MessageQueue queue(1000);
  const std::vector<uint8_t> data(400, 7);
  CHECK(queue.push("A", 1, data));
  CHECK(queue.push("B", 2, data));
  CHECK_FALSE(queue.push("B", 3, data));
  CHECK_FALSE(queue.push("C", 4, data));
  CHECK(queue.dropped() == std::map<std::string, int64_t>{{"B", 1}, {"C", 1}});
  CHECK(queue.bytes() == 800);
  CHECK(queue.pop(milliseconds(0))->channel == "A");
  CHECK(queue.push("D", 5, data));
  CHECK(queue.pop(milliseconds(0))->received_us == 2);
  CHECK(queue.pop(milliseconds(0))->channel == "D");
  CHECK_FALSE(queue.pop(milliseconds(1)));
  CHECK(queue.bytes() == 0);
}

TEST_CASE("small messages are not limited in number") {
  MessageQueue queue(1 << 20);
  for (int i = 0; i < 10000; ++i) REQUIRE(queue.push("IMU", i, std::vector<uint8_t>(80)));
  CHECK(queue.size() == 10000);
}

TEST_CASE("a consumer in another thread gets everything") {
  MessageQueue queue(1 << 20);
  int received = 0;
  std::thread consumer([&] {
    while (received < 5000 && queue.pop(milliseconds(60'000))) ++received;
  });
  for (int i = 0; i < 5000; ++i) queue.push("IMU", i, std::vector<uint8_t>(80));
  consumer.join();
  CHECK(received == 5000);
}

}  // namespace
}  // namespace roadfix
