// A horizon that follows how late the inputs come.
#include <catch2/catch.hpp>
#include <cmath>

#include "support/recorded_stage.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

StageSpec spec_with_horizon() {
  StageSpec spec = filter_spec();
  spec.inputs.push_back({"HORIZON_FILTER", "horizon_t"});
  return spec;
}

/// The small drive in the order of its arrival: GNSS comes `late_us(utime)` behind its stamp.
template <class Lateness>
std::vector<DriveMessage> arriving(const std::vector<DriveMessage>& drive, const Lateness& late_us) {
  std::multimap<int64_t, DriveMessage> arrivals;
  for (const DriveMessage& message : drive) {
    arrivals.emplace(message.header.utime + (message.channel == "GNSS" ? late_us(message.header.utime) : 0), message);
  }
  std::vector<DriveMessage> in_order;
  for (auto& [at, message] : arrivals) in_order.push_back(std::move(message));
  return in_order;
}

int64_t horizon_of(const Recorder& recorder) {
  const InputStream& stream = recorder.live().runner().stream();
  return *stream.clock_utime() - *stream.horizon_utime();
}

}  // namespace

TEST_CASE("a horizon that follows how late the inputs are is recorded, and verified like any input") {
  const TemporaryFolder folder;
  const auto late_us = [](int64_t utime) {
    const int64_t at = utime - kDriveStart_us;
    return at > 20'000'000 && at < 25'000'000 ? 140'000 : 55'000;
  };
  const std::vector<DriveMessage> drive = arriving(small_drive(60.0), late_us);
  Recorder recorder(maker(spec_with_horizon()));
  std::size_t played = 0;
  const auto play_until = [&](double seconds) {
    for (; played < drive.size() && drive[played].header.utime < kDriveStart_us + std::llround(seconds * 1e6);
         ++played) {
      recorder.play(drive[played]);
      recorder.step();
    }
  };
  play_until(18.0);
  REQUIRE(horizon_of(recorder) == 100'000);  // not the 250 ms that are stated for GNSS
  play_until(24.0);
  REQUIRE(horizon_of(recorder) == 200'000);
  play_until(60.0);
  REQUIRE(horizon_of(recorder) == 100'000);
  recorder.stop();
  const InputCounters& gnss = recorder.live().runner().stream().track(1).counters;
  REQUIRE(gnss.received == 240);
  REQUIRE(gnss.late == 2);  // the first two of the later ones, and no more
  require_all_identical(recorder.verdict(), 6000);

  std::vector<LoggedEvent> without = recorder.log();
  const auto second = [n = 0](const LoggedEvent& event) mutable {
    return event.channel == "HORIZON_FILTER" && ++n == 2;
  };
  REQUIRE(std::erase_if(without, second) == 1);
  write_events(folder / "without.lcm", without);
  const StageVerdict lost = verify({folder / "without.lcm"}, {maker(spec_with_horizon())}).stages.at(0);
  REQUIRE(lost.differing() == 0);
  REQUIRE(lost.unverifiable() > 100);
  REQUIRE(lost.identical() > 4500);
}

TEST_CASE("without word of how late the inputs are, a replay lets them be as late as stated") {
  struct NoSink : MessageSink {
    void put(const std::string&, const Header&, std::span<const uint8_t>) override {}
  } sink;
  StageRunner runner(std::make_unique<ChainStage>(spec_with_horizon()), sink);
  for (const DriveMessage& message : small_drive(3.0)) {
    if (message.channel == "IMU") runner.offer(0, message.bytes);
  }
  REQUIRE(*runner.stream().clock_utime() - *runner.stream().horizon_utime() == 250'000);
}
