// The bus over real UDP, in a network namespace: no silent limit, nothing dropped without a count, and what a handler
// throws does not pass through LCM's C code.
#include "bus/transport/network_bus.h"

#include <catch2/catch.hpp>
#include <cstdlib>

using namespace roadfix;

namespace {

constexpr const char* kUrl = "udpm://239.255.76.67:7667?ttl=0";

void publish(NetworkBus& bus, const std::string& channel, int count, std::size_t size) {
  for (int i = 0; i < count; ++i) bus.publish(channel, std::vector<uint8_t>(size, static_cast<uint8_t>(i)));
}

/// Handles what comes until `done`, or for ten seconds.
template <class Done>
bool handle_until(NetworkBus& bus, const Done& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!done() && std::chrono::steady_clock::now() < end) bus.handle(std::chrono::milliseconds(50));
  return done();
}

}  // namespace

TEST_CASE("three hundred messages that wait all come, in order, where LCM's own queue keeps thirty") {
  NetworkBus from(kUrl), to(kUrl);
  std::vector<uint8_t> seen;
  to.subscribe("A", [&](const BusMessage& message) { seen.push_back(message.bytes[0]); });
  publish(from, "A", 300, 100);
  REQUIRE(handle_until(to, [&] { return seen.size() == 300; }));
  for (std::size_t i = 0; i < seen.size(); ++i) REQUIRE(seen[i] == static_cast<uint8_t>(i));
  REQUIRE(to.queues().at(0).received == 300);
  REQUIRE(to.queues().at(0).dropped == 0);
}

TEST_CASE("what does not fit into a queue is dropped and counted") {
  NetworkBus from(kUrl), to(kUrl);
  int64_t handled = 0;
  to.subscribe("B", [&](const BusMessage&) { ++handled; }, {.max_bytes = 1000});
  publish(from, "B", 100, 300);
  REQUIRE(handle_until(to, [&] { return to.queues().at(0).received == 100; }));
  REQUIRE(handle_until(to, [&] { return to.queues().at(0).depth == 0; }));
  REQUIRE(to.queues().at(0).dropped > 0);
  REQUIRE(handled + to.queues().at(0).dropped == 100);
}

TEST_CASE("what a handler throws comes out of handle(), and the bus goes on") {
  NetworkBus from(kUrl), to(kUrl);
  int handled = 0;
  to.subscribe("C", [&](const BusMessage&) {
    if (++handled == 1) throw std::runtime_error("broken handler");
  });
  publish(from, "C", 3, 10);
  REQUIRE_THROWS_WITH(handle_until(to, [&] { return handled == 3; }), "broken handler");
  REQUIRE(handle_until(to, [&] { return handled == 3; }));
}

TEST_CASE("a bus that cannot be opened or used says why") {
  REQUIRE_THROWS_WITH(NetworkBus("udpm://239.255.76.67:port"), Catch::Contains("no such port"));
  REQUIRE_THROWS_WITH(NetworkBus("nonsense://"), Catch::Contains("roadfix doctor"));
  NetworkBus bus(kUrl);
  REQUIRE_THROWS_AS(bus.publish("", std::vector<uint8_t>(3)), BusError);
  REQUIRE_THROWS_AS(bus.publish(std::string(64, 'x'), std::vector<uint8_t>(3)), BusError);
}

TEST_CASE("a network that is gone costs the messages of that time, which are counted, and nothing else") {
  NetworkBus from(kUrl), to(kUrl);
  std::vector<uint8_t> seen;
  to.subscribe("D", [&](const BusMessage& message) { seen.push_back(message.bytes[0]); });
  publish(from, "D", 3, 100);
  REQUIRE(handle_until(to, [&] { return seen.size() == 3; }));
  REQUIRE(from.unsent() == 0);
  REQUIRE(std::system("ip route del 224.0.0.0/4 dev lo") == 0);
  publish(from, "D", 5, 100);
  publish(from, "D", 1, 200'000);  // in many datagrams
  REQUIRE(from.unsent() == 6);
  REQUIRE(std::system("ip route add 224.0.0.0/4 dev lo") == 0);
  publish(from, "D", 4, 100);
  REQUIRE(handle_until(to, [&] { return seen.size() == 7; }));
  REQUIRE(from.unsent() == 6);
}
