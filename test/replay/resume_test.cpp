#include <catch2/catch.hpp>

#include "bus/run/stage_runner.h"
#include "support/chain_stage.h"
#include "support/small_drive.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

struct Caught : MessageSink {
  std::vector<std::pair<int64_t, std::vector<uint8_t>>> poses;
  std::vector<state_t> states;
  void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) override {
    if (channel == "POSE_INS") poses.emplace_back(header.utime, std::vector<uint8_t>(bytes.begin(), bytes.end()));
    if (channel == "STATE_FILTER") states.push_back(decode<state_t>(bytes));
  }
};

void offer_all(StageRunner& runner, const std::vector<DriveMessage>& drive, int64_t behind_utime) {
  for (const DriveMessage& message : drive) {
    for (int i = 0; i < static_cast<int>(runner.spec().inputs.size()); ++i) {
      const bool its = runner.spec().inputs[static_cast<std::size_t>(i)].channel == message.channel;
      if (its && message.header.utime > behind_utime) runner.offer(i, message.bytes);
    }
  }
}

}  // namespace

TEST_CASE("a stage that begins at a snapshot publishes what the one that never stopped publishes") {
  const std::vector<DriveMessage> drive = small_drive(40.0);
  Caught whole;
  StageRunner runner(std::make_unique<ChainStage>(filter_spec()), whole);
  offer_all(runner, drive, 0);
  REQUIRE(whole.states.size() >= 4);
  for (std::size_t i = 1; i < whole.states.size(); ++i) {
    REQUIRE(whole.states[i].utime - whole.states[i - 1].utime <= 9'000'000);
  }
  for (const state_t& state : whole.states) {
    Caught rest;
    StageRunner resumed(std::make_unique<ChainStage>(filter_spec()), rest);
    resumed.resume(state);
    offer_all(resumed, drive, state.horizon_utime);
    const auto from = std::find_if(whole.poses.begin(), whole.poses.end(),
                                   [&](const auto& pose) { return pose.first > state.utime; });
    REQUIRE(rest.poses == std::vector(from, whole.poses.end()));
    for (const state_t& later : rest.states) {
      const auto same = std::find_if(whole.states.begin(), whole.states.end(),
                                     [&](const state_t& s) { return s.utime == later.utime; });
      REQUIRE(same != whole.states.end());
      REQUIRE(encode(*same) == encode(later));
    }
  }
}

TEST_CASE("a snapshot of another stage, layout or version is refused") {
  Caught whole;
  StageRunner runner(std::make_unique<ChainStage>(filter_spec()), whole);
  offer_all(runner, small_drive(20.0), 0);
  const state_t good = whole.states.at(0);
  const auto refused = [&](state_t state) {
    Caught ignored;
    StageRunner other(std::make_unique<ChainStage>(filter_spec()), ignored);
    REQUIRE_THROWS_AS(other.resume(state), std::runtime_error);
  };
  state_t state = good;
  state.process = "fusion";
  refused(state);
  state = good;
  state.layout = 2;
  refused(state);
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, good.state.size() / 2, good.state.size() - 1}) {
    state = good;
    state.state.resize(size);
    refused(state);
  }
}
