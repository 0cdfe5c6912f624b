#include "bus/verify/verify.h"

#include <catch2/catch.hpp>
#include <random>

#include "support/recorded_car.h"
#include "support/temporary_folder.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

const std::vector<StageSpec>& all_specs() {
  static const std::vector<StageSpec> kSpecs = {odometry_spec(), filter_spec(), fusion_spec()};
  return kSpecs;
}

std::vector<NewStage> all_stages(double factor = 0.99) {
  std::vector<NewStage> stages;
  for (const StageSpec& spec : all_specs()) {
    stages.emplace_back([&spec, factor] { return std::make_unique<ChainStage>(spec, factor); });
  }
  return stages;
}

std::vector<LoggedEvent> record(const CarTroubles& troubles, double seconds = 60.0) {
  return RecordedCar(all_specs(), troubles).drive(small_drive(seconds));
}

VerifyReport verify_events(const std::vector<LoggedEvent>& events, double factor = 0.99) {
  const TemporaryFolder folder;
  write_events(folder / "drive.lcm", events);
  return verify({folder / "drive.lcm"}, all_stages(factor));
}

struct Totals {
  int64_t identical = 0;
  int64_t differing = 0;
  int64_t unverifiable = 0;
  std::string words;  ///< what verify says, for the log of a failing test
};

Totals totals(const VerifyReport& report) {
  Totals totals;
  for (const StageVerdict& stage : report.stages) {
    for (const RunVerdict& run : stage.runs) {
      if (run.first_difference) totals.words += stage.stage + ": " + *run.first_difference + "\n";
      for (const std::string& finding : run.findings) totals.words += stage.stage + ": " + finding + "\n";
    }
    totals.identical += stage.identical();
    totals.differing += stage.differing();
    totals.unverifiable += stage.unverifiable();
  }
  return totals;
}

const StageVerdict& stage_of(const VerifyReport& report, const std::string& name) {
  return *std::find_if(report.stages.begin(), report.stages.end(),
                       [&](const StageVerdict& stage) { return stage.stage == name; });
}

/// A few per cent of everything, but not of what only describes the run.
Drops random_drops(const std::string& to_prefix, unsigned per_mille) {
  auto random = std::make_shared<std::mt19937>(9);
  return [=](const std::string& to, const std::string&, const Header&) {
    return to.starts_with(to_prefix) && (*random)() % 1000 < per_mille;
  };
}

}  // namespace

TEST_CASE("a clean drive: everything identical") {
  const VerifyReport report = verify_events(record({}));
  const Totals sum = totals(report);
  REQUIRE(report.stages.size() == 3);
  REQUIRE(sum.identical == 18'000);
  REQUIRE(sum.differing == 0);
  REQUIRE(sum.unverifiable == 0);
  REQUIRE(report.stages[0].config_differences.empty());
}

TEST_CASE("stages that lose 3 % of their inputs, late ones and all: everything identical") {
  CarTroubles troubles;
  troubles.delay_us = 300'000;
  troubles.drops = [starved = random_drops("", 30)](const std::string& to, const std::string& channel,
                                                    const Header& header) {
    return to != "log" && starved(to, channel, header);
  };
  const Totals sum = totals(verify_events(record(troubles)));
  CAPTURE(sum.words);
  REQUIRE(sum.identical > 15'000);
  REQUIRE(sum.differing == 0);
  REQUIRE(sum.unverifiable == 0);
}

TEST_CASE("a stage killed and restarted in mid-drive: everything identical") {
  CarTroubles troubles;
  troubles.killed_stage = "filter";
  troubles.killed_at_us = 23'456'000;
  const VerifyReport report = verify_events(record(troubles));
  REQUIRE(stage_of(report, "filter").runs.size() == 2);
  const Totals sum = totals(report);
  REQUIRE(sum.identical > 17'000);
  REQUIRE(sum.differing == 0);
  REQUIRE(sum.unverifiable == 0);
}

TEST_CASE("the clock silent for 3 s and back: everything identical, also where another clock took over") {
  for (const std::string silent : {"IMU", "POSE_INS"}) {
    CAPTURE(silent);
    CarTroubles troubles;
    troubles.drops = [&](const std::string& to, const std::string& channel, const Header& header) {
      const int64_t elapsed = header.utime - kDriveStart_us;
      return to != "log" && channel == silent && elapsed > 20'000'000 && elapsed < 23'000'000;
    };
    const VerifyReport report = verify_events(record(troubles));
    const Totals sum = totals(report);
    CAPTURE(sum.words);
    REQUIRE(sum.identical > 15'000);
    REQUIRE(sum.differing == 0);
    REQUIRE(sum.unverifiable == 0);
    if (silent == "POSE_INS") REQUIRE(stage_of(report, "fusion").identical() > 5970);
  }
}

TEST_CASE("a recording begun in mid-drive: nothing differs, at most 10 s are unverifiable") {
  for (const int64_t from_us : {10'000'000, 13'337'000, 26'999'000, 27'100'000}) {
    CAPTURE(from_us);
    CarTroubles troubles;
    troubles.log_from_us = from_us;
    const VerifyReport report = verify_events(record(troubles));
    REQUIRE(totals(report).differing == 0);
    REQUIRE(totals(report).identical > 6000);
    for (const StageVerdict& stage : report.stages) REQUIRE(stage.unverifiable() <= 1000);
  }
}

TEST_CASE("one message that the logger lost: nothing differs, at most 10 s are unverifiable") {
  struct Lost {
    std::string channel;
    int64_t seq;
  };
  for (const Lost& lost :
       std::vector<Lost>{{"IMU", 2003}, {"IMU", 2690}, {"GNSS", 80}, {"WHEELS", 1234}, {"POSE_INS", 2500}}) {
    CAPTURE(lost.channel, lost.seq);
    CarTroubles troubles;
    troubles.drops = [&](const std::string& to, const std::string& channel, const Header& header) {
      return to == "log" && channel == lost.channel && header.seq == lost.seq;
    };
    const VerifyReport report = verify_events(record(troubles));
    REQUIRE(totals(report).differing == 0);
    int64_t unverifiable = 0;
    for (const StageVerdict& stage : report.stages) {
      REQUIRE(stage.unverifiable() <= 1000);
      unverifiable += stage.unverifiable();
      if (stage.unverifiable() > 0) REQUIRE_THAT(stage.runs.at(0).losses.at(0), Catch::Contains(lost.channel));
    }
    REQUIRE(unverifiable > 0);
  }
}

TEST_CASE("a logger that loses 1 % of everything: nothing differs") {
  CarTroubles troubles;
  troubles.drops = random_drops("log", 1);
  const Totals sum = totals(verify_events(record(troubles)));
  REQUIRE(sum.differing == 0);
  REQUIRE(sum.identical > 0);
  REQUIRE(sum.unverifiable > 0);
}

TEST_CASE("a split log is one recording, whatever the order of its files") {
  const std::vector<LoggedEvent> events = record({});
  const TemporaryFolder folder;
  const std::span<const LoggedEvent> all(events);
  const std::size_t third = events.size() / 3;
  write_events(folder / "0.lcm", all.first(third));
  write_events(folder / "1.lcm", all.subspan(third, third));
  write_events(folder / "2.lcm", all.subspan(2 * third));
  const VerifyReport report = verify({folder / "2.lcm", folder / "0.lcm", folder / "1.lcm"}, all_stages());
  const Totals sum = totals(report);
  REQUIRE(sum.identical == 18'000);
  REQUIRE(sum.differing + sum.unverifiable == 0);
}

TEST_CASE("two hosts, a recorder on each: what one of them lost the other has") {
  const std::vector<LoggedEvent> all = record({});
  std::mt19937 random(7);
  std::vector<LoggedEvent> here, there;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool cut = i > all.size() / 3 && i < all.size() / 2;  // then each hears its own host only
    const bool odometry = all[i].channel == "POSE_WHEEL" || all[i].channel.ends_with("WHEEL_ODOMETRY");
    const auto chance = random() % 100;
    if (cut ? !odometry : chance >= 3) here.push_back(all[i]);
    if (cut ? odometry : chance < 97) there.push_back(all[i]);
  }
  const TemporaryFolder folder;
  const auto sums = [&] {
    write_events(folder / "here.lcm", here);
    write_events(folder / "there.lcm", there);
    return totals(verify({folder / "here.lcm", folder / "there.lcm"}, all_stages()));
  };
  REQUIRE(totals(verify_events(here)).unverifiable > 1000);  // teeth: alone it does not suffice
  const Totals sum = sums();
  INFO(sum.words);
  REQUIRE(sum.identical == 18'000);
  REQUIRE(sum.differing + sum.unverifiable == 0);
  // Teeth: what both lost is lost, and a copy that is none shows.
  const auto is_imu = [](const LoggedEvent& event) { return event.channel == "IMU" && event.header.seq == 2003; };
  std::erase_if(here, is_imu);
  std::erase_if(there, is_imu);
  REQUIRE(sums().unverifiable > 0);
  for (LoggedEvent& event : there) {
    if (event.channel == "POSE_INS" && event.header.seq == 500) event.bytes.back() ^= 1U;
  }
  REQUIRE(sums().differing == 1);
}

TEST_CASE("a bit flipped in one logged input is found, named, and over at the next snapshot") {
  for (const std::string channel : {"IMU", "GNSS"}) {
    CAPTURE(channel);
    std::vector<LoggedEvent> events = record({});
    const int64_t seq = channel == "IMU" ? 2500 : 100;
    const auto flipped = std::find_if(events.begin(), events.end(), [&](const LoggedEvent& event) {
      return event.channel == channel && event.header.seq == seq;
    });
    // The lowest bit of the value that the stages read.
    const std::size_t place = channel == "IMU" ? 8 + 24 + 7 : 8 + 24 + 2 + 16 + 7;
    flipped->bytes[place] ^= 1;
    const VerifyReport report = verify_events(events);
    const StageVerdict& filter = stage_of(report, "filter");
    REQUIRE(filter.differing() > 100);
    REQUIRE(filter.differing() <= 1000);
    REQUIRE(filter.identical() >= 5000);
    REQUIRE_THAT(*filter.runs.at(0).first_difference, Catch::Contains("POSE_INS seq"));
    if (channel == "GNSS") {
      REQUIRE_THAT(*filter.runs.at(0).first_difference, Catch::Contains("GNSS seq 100"));
    }
  }
}

TEST_CASE("a ledger entry removed is found and named") {
  CarTroubles troubles;
  troubles.drops = [](const std::string& to, const std::string& channel, const Header& header) {
    return to == "filter" && channel == "GNSS" && header.seq == 77;
  };
  std::vector<LoggedEvent> events = record(troubles);
  int removed = 0;
  for (LoggedEvent& event : events) {
    if (event.channel != "LEDGER_FILTER") continue;
    ledger_t ledger = decode<ledger_t>(event.bytes);
    removed += static_cast<int>(std::erase_if(ledger.entries, [](const ledger_entry_t& entry) {
      return entry.kind == ledger_entry_t::KIND_LOST && entry.channel == "GNSS";
    }));
    ledger.num_entries = static_cast<int32_t>(ledger.entries.size());
    event.bytes = encode(ledger);
  }
  REQUIRE(removed > 0);
  const VerifyReport report = verify_events(events);
  const StageVerdict& filter = stage_of(report, "filter");
  REQUIRE(filter.differing() > 0);
  REQUIRE_THAT(filter.runs.at(0).findings.at(0), Catch::Contains("ledger entries"));
  REQUIRE_THAT(*filter.runs.at(0).first_difference, Catch::Contains("GNSS"));
}

TEST_CASE("one configuration value changed is named first, and everything differs") {
  const VerifyReport report = verify_events(record({}), 0.98);
  for (const StageVerdict& stage : report.stages) {
    REQUIRE(stage.identical() <= 1);  // the first, while the state is still zero
    REQUIRE(stage.config_differences.size() == 1);
    REQUIRE_THAT(stage.config_differences[0],
                 Catch::Contains("'factor: 0.99' in the car") && Catch::Contains("'factor: 0.98' here"));
  }
}

TEST_CASE("a recorded output that was changed is found") {
  std::vector<LoggedEvent> events = record({}, 20.0);
  const auto changed = std::find_if(events.begin(), events.end(), [](const LoggedEvent& event) {
    return event.channel == "POSE_FUSED" && event.header.seq == 1000;
  });
  changed->bytes.back() ^= 1;
  const Totals sum = totals(verify_events(events));
  REQUIRE(sum.differing == 1);
  REQUIRE(sum.identical == 5999);
}

TEST_CASE("an output that does not say what it was made of costs no more than the loss beside it") {
  std::vector<LoggedEvent> events = record({});
  std::erase_if(events, [](const LoggedEvent& e) { return e.channel == "GNSS" && e.header.seq == 100; });
  for (LoggedEvent& event : events) {
    const int64_t t_us = event.header.utime - kDriveStart_us;
    if (event.channel != "POSE_INS" || t_us < 24'000'000 || t_us > 27'000'000) continue;
    pose_t pose = decode<pose_t>(event.bytes);
    pose.provenance = {};  // as another program's on this channel
    event.bytes = encode(pose);
  }
  const StageVerdict verdict = stage_of(verify_events(events), "filter");
  CHECK(verdict.identical() > 4500);
  CHECK(verdict.differing() + verdict.unverifiable() > 0);
}
