// The stages that a car runs, on the demo drive: neither the order of arrival, nor duplicates, nor threads beside it
// show in a single byte.
#include <catch2/catch.hpp>
#include <random>
#include <thread>

#include "bus/log_reader.h"
#include "bus/stage_memory.h"
#include "bus/stage_runner.h"
#include "roadfix/stages.h"
#include "support/shared_data.h"

using namespace roadfix;

namespace {

constexpr double kSeconds = 20.0;

struct LoggedMessage {
  std::string channel;
  Header header;
  std::vector<uint8_t> bytes;
};

/// The beginning of the demo drive.
const std::vector<LoggedMessage>& demo() {
  static const std::vector<LoggedMessage> kDemo = [] {
    LogReader reader(test::source_path("logs/demo.lcm"));
    std::vector<LoggedMessage> all;
    while (const auto event = reader.next()) {
      const Header header = *read_header(event->data);
      all.push_back({std::string(event->channel), header, {event->data.begin(), event->data.end()}});
    }
    int64_t first = all.front().header.utime;
    for (const LoggedMessage& message : all) first = std::min(first, message.header.utime);
    std::erase_if(all, [&](const LoggedMessage& message) {
      return message.header.utime - first > static_cast<int64_t>(kSeconds * 1e6);
    });
    return all;
  }();
  return kDemo;
}

struct Delivery {
  int64_t arrives = 0;
  int order = 0;
  int input = 0;
  const LoggedMessage* message = nullptr;
};

/// The stage's inputs as they arrive: the first clock in its own order, the others less than their lateness behind, and
/// every third twice where duplicates are wanted. Without a seed, nothing is late.
std::vector<Delivery> deliveries(const StageSpec& spec, std::optional<unsigned> seed, bool duplicates,
                                 int64_t extra_us = 0) {
  std::mt19937_64 random(seed.value_or(0));
  std::vector<Delivery> all;
  for (const LoggedMessage& message : demo()) {
    for (int input = 0; input < static_cast<int>(spec.inputs.size()); ++input) {
      const InputSpec& declared = spec.inputs[static_cast<std::size_t>(input)];
      if (declared.channel != message.channel) continue;
      const int64_t window = input == spec.clocks.front().input ? 0 : declared.lateness_us;
      const int64_t delay = seed && window > 0 ? static_cast<int64_t>(random() % static_cast<uint64_t>(window)) : 0;
      const int64_t arrives = message.header.utime + delay + (window > 0 ? extra_us : 0);
      all.push_back({arrives, delivery_order(spec, input), input, &message});
      if (duplicates && message.header.seq % 3 == 0) {
        const auto later = static_cast<int64_t>(random() % 400'000);
        all.push_back({arrives + later, delivery_order(spec, input), input, &message});
      }
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const Delivery& a, const Delivery& b) {
    return std::tie(a.arrives, a.order) < std::tie(b.arrives, b.order);
  });
  return all;
}

/// Every output and snapshot, byte for byte, one behind the other. A snapshot tells what has arrived and waits, too.
struct Published : MessageSink {
  std::vector<uint8_t> outputs;
  std::vector<uint8_t> states;
  int64_t messages = 0;
  void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
    if (channel.starts_with("LEDGER_")) return;
    auto& to = channel.starts_with("STATE_") ? states : outputs;
    to.insert(to.end(), bytes.begin(), bytes.end());
    ++messages;
  }
};

Published run(const std::string& stage, const std::vector<Delivery>& all) {
  Published published;
  StageRunner runner(std::move(make_stages({stage}, test::source_path("configs/demo")).front()), published);
  for (const Delivery& delivery : all) runner.offer(delivery.input, delivery.message->bytes);
  return published;
}

StageSpec spec_of(const std::string& stage) {
  return make_stages({stage}, test::source_path("configs/demo")).front()->spec();
}

/// Those that the demo drive's sensors suffice for.
const std::vector<std::string> kDemoStages = {"gnss_ins_ekf", "wheel_odometry"};

}  // namespace

TEST_CASE("200 orders of arrival within the lateness, half of them with duplicates: the same bytes") {
  for (const std::string& stage : kDemoStages) {
    CAPTURE(stage);
    const StageSpec spec = spec_of(stage);
    const Published expected = run(stage, deliveries(spec, std::nullopt, false));
    REQUIRE(expected.messages > 500);
    REQUIRE(!expected.states.empty());
    for (unsigned seed = 1; seed <= 200; ++seed) {
      CAPTURE(seed);
      const Published shuffled = run(stage, deliveries(spec, seed, seed % 2 == 0));
      REQUIRE(shuffled.outputs == expected.outputs);
    }
    // The comparison can fail: beyond the lateness inputs are refused, and that shows.
    REQUIRE(run(stage, deliveries(spec, 1, false, 300'000)).outputs != expected.outputs);
  }
}

TEST_CASE("four stages beside each other in threads: the same bytes as alone") {
  for (const std::string& stage : kDemoStages) {
    CAPTURE(stage);
    const std::vector<Delivery> all = deliveries(spec_of(stage), 5, false);
    const Published alone = run(stage, all);
    std::vector<Published> beside(4);
    std::vector<std::thread> threads;
    for (Published& published : beside) threads.emplace_back([&] { published = run(stage, all); });
    for (std::thread& thread : threads) thread.join();
    for (const Published& published : beside) {
      REQUIRE(published.outputs == alone.outputs);
      REQUIRE(published.states == alone.states);
    }
  }
}

namespace {

/// What a stage remembers after the demo drive, where it began with `memory` (empty: with none).
std::vector<uint8_t> remembered(const std::string& stage, const std::vector<uint8_t>& memory) {
  Published published;
  StageRunner runner(std::move(make_stages({stage}, test::source_path("configs/demo")).front()), published);
  const StageSpec& spec = runner.spec();
  const std::vector<Delivery> all = deliveries(spec, std::nullopt, false);
  if (!memory.empty()) {
    state_t start{};
    start.utime = all.front().message->header.utime - 250'000;
    start.run = start.utime;
    start.process = spec.name;
    start.layout = spec.state_layout;
    start.state = memory;
    start.size_bytes = static_cast<int32_t>(memory.size());
    const std::vector<uint8_t> bytes = encode(start);
    REQUIRE(memory_input(spec) >= 0);
    runner.offer(memory_input(spec), bytes);
  }
  for (const Delivery& delivery : all) runner.offer(delivery.input, delivery.message->bytes);
  return runner.stage().memory();
}

}  // namespace

TEST_CASE("what a shipped stage remembers comes back through its START input") {
  for (const std::string& stage : kDemoStages) {
    CAPTURE(stage);
    std::vector<uint8_t> memory = remembered(stage, {});
    REQUIRE(!memory.empty());
    const std::vector<uint8_t> cold = memory;
    REQUIRE(remembered(stage, memory) != cold);
    // Another version's bytes are not taken for numbers.
    memory.push_back(0);
    REQUIRE(remembered(stage, memory) == cold);
  }
}
