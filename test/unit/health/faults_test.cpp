// Each fault is told within a second and forgotten within two of its end; the same drive without it says "ok".
#include <catch2/catch.hpp>
#include <cmath>

#include "small_car.h"

using namespace roadfix;
using test::SmallCar;

namespace {

constexpr double kFault = 10.0, kMended = 15.0;
bool faulty(double t) { return t >= kFault && t < kMended; }

/// Drives with the fault between 10 and 15 s. `key` must be told in time and be gone in time.
void check_told(SmallCar& car, const std::string& key, Verdict verdict) {
  car.drive(0.0, kFault);
  INFO(car.reasons());
  REQUIRE(car.health.verdict() == Verdict::kOk);
  const double reported = car.reported(key, kFault, kMended);
  INFO(key << " told at " << reported << "\n" << car.reasons());
  CHECK(reported >= kFault);
  CHECK(reported <= kFault + 1.0);
  Verdict worst = Verdict::kOk;
  car.drive(kMended, kMended + 0.2, [&](double) { worst = std::max(worst, car.health.verdict()); });
  CHECK(worst == verdict);
  car.drive(kMended + 0.2, kMended + 1.8);
  CHECK(car.health.verdict() == Verdict::kOk);
}

}  // namespace

TEST_CASE("a drive without faults is ok from the end of learning on") {
  SmallCar car;
  bool always = true;
  car.drive(0.0, 5.0);
  car.drive(5.0, 60.0, [&](double) { always = always && car.health.verdict() == Verdict::kOk; });
  INFO(car.reasons());
  CHECK(always);
  CHECK(car.health.report().judged_pose == "POSE_FUSED");
}

TEST_CASE("a sensor that falls silent") {
  SmallCar car;
  car.arrival = [](const std::string& channel, double t, Arrival&) { return channel != "GNSS" || !faulty(t); };
  check_told(car, "channel.GNSS.silent", Verdict::kDegraded);
}

TEST_CASE("the judged estimate falls silent: do not use") {
  SmallCar car;
  car.arrival = [](const std::string& channel, double t, Arrival&) { return channel != "POSE_FUSED" || !faulty(t); };
  check_told(car, "channel.POSE_FUSED.silent", Verdict::kDoNotUse);
}

TEST_CASE("a sensor that loses every third message, and one that loses one in fifty") {
  for (const int nth : {3, 50}) {
    SmallCar car;
    car.arrival = [&](const std::string& channel, double t, Arrival& a) {
      return channel != "IMU" || !faulty(t) || a.seq % nth != 0;
    };
    if (nth == 3) {
      check_told(car, "channel.IMU.lost", Verdict::kDegraded);
      CHECK(car.health.report().channels[1].lost > 100);
    } else {
      car.drive(0.0, kMended);
      CHECK(car.health.verdict() == Verdict::kOk);
      CHECK(car.health.report().channels[1].name == "IMU");
      CHECK(car.health.report().channels[1].lost == 10);
    }
  }
}

TEST_CASE("a sensor at half its rate") {
  SmallCar car;
  int64_t sent = 0;
  car.arrival = [&](const std::string& channel, double t, Arrival& a) {
    if (channel != "IMU") return true;
    if (faulty(t) && std::lround(t * 100) % 2 == 1) return false;
    a.seq = sent++;
    return true;
  };
  car.drive(0.0, kFault);
  REQUIRE(car.health.verdict() == Verdict::kOk);
  CHECK(car.reported("channel.IMU.slow", kFault, kMended) > kFault);
}

TEST_CASE("a burst is no new rate, a rate that stays is") {
  for (const double burst_s : {2.0, 8.0}) {
    ChannelMonitor monitor("VO_STATUS", ChannelLimits{}, std::nullopt);
    bool slow = false;
    int64_t seq = 0;
    for (int i = 0; i < 3000; ++i) {
      const double t = 0.01 * i;
      const bool burst = t >= 10.0 && t < 10.0 + burst_s;
      if (burst || i % 10 == 0) monitor.arrived({test::at(t), test::at(t), 1, seq++, 100, std::nullopt});
      std::vector<Condition> conditions;
      if (i % 10 == 0) monitor.check(test::at(t), 0, 0, Verdict::kDegraded, conditions);
      slow = slow || (t > 25.0 && !conditions.empty());
    }
    CHECK(slow == (burst_s > 5.0));
  }
}

TEST_CASE("stamps: late, ahead, jumping") {
  const auto shifted = [](double by_s) {
    SmallCar car;
    car.arrival = [by_s](const std::string& channel, double t, Arrival& a) {
      if (channel == "GNSS" && faulty(t)) a.utime += static_cast<int64_t>(by_s * 1e6);
      return true;
    };
    return car;
  };
  SECTION("a jump is told at once, forth and back") {
    SmallCar car = shifted(-5.0);
    check_told(car, "channel.GNSS.stamp_jump", Verdict::kDegraded);
  }
  SECTION("late") {
    SmallCar car = shifted(-0.45);
    car.drive(0.0, kFault);
    CHECK(car.reported("channel.GNSS.late", kFault, kMended) > 0.0);
  }
  SECTION("ahead") {
    SmallCar car = shifted(0.3);
    car.drive(0.0, kFault);
    CHECK(car.reported("channel.GNSS.ahead", kFault, kMended) > 0.0);
  }
  SECTION("a little late is no fault") {
    SmallCar car = shifted(-0.15);
    car.drive(0.0, kMended);
    CHECK(car.health.verdict() == Verdict::kOk);
  }
}

TEST_CASE("a drive that is played again years later is judged the same") {
  SmallCar car;
  car.lag_us = int64_t{3} * 365 * 86'400 * 1'000'000;
  car.drive(0.0, kFault);
  INFO(car.reasons());
  CHECK(car.health.verdict() == Verdict::kOk);
  CHECK(car.health.report().lag_s == Approx(static_cast<double>(car.lag_us) * 1e-6).margin(0.1));
  car.arrival = [](const std::string& channel, double t, Arrival&) { return channel != "GNSS" || !faulty(t); };
  CHECK(car.reported("channel.GNSS.silent", kFault, kMended) < kFault + 1.0);
}

TEST_CASE("channels that were forged for a moment do not set the time of the others") {
  SmallCar car;
  car.drive(0.0, kFault);
  for (int i = 0; i < 40; ++i) {  // more than the car has
    car.health.arrived("FORGED_" + std::to_string(i),
                       {test::at(kFault), test::at(kFault) - 3'600'000'000, 1, 1, 100, {}});
  }
  car.drive(kFault, kFault + 1.0);
  CHECK(std::abs(car.health.report().lag_s) > 3000.0);  // teeth: for a moment it does
  car.drive(kFault + 1.0, kFault + 3.0);
  INFO(car.reasons());
  CHECK(car.health.report().lag_s == 0.0);
  CHECK(car.health.verdict() == Verdict::kOk);
}

TEST_CASE("a frozen sensor repeats itself, a sensor that differs does not") {
  SmallCar car;
  car.arrival = [](const std::string& channel, double t, Arrival& a) {
    if (channel == "IMU" && faulty(t)) a.content = 7;
    return true;
  };
  check_told(car, "channel.IMU.frozen", Verdict::kDegraded);
}

TEST_CASE("garbage, numbers that are none, two publishers") {
  SmallCar car;
  car.tick = [&](double t) {
    if (faulty(t)) car.health.undecodable("GNSS", test::at(t), "ends too early");
  };
  check_told(car, "channel.GNSS.undecodable", Verdict::kDegraded);

  SmallCar other;
  other.tick = [&](double t) {
    if (faulty(t)) other.health.unusable("IMU", test::at(t));
  };
  check_told(other, "channel.IMU.unusable", Verdict::kDegraded);

  SmallCar third;
  third.arrival = [](const std::string& channel, double t, Arrival& a) {
    if (channel == "IMU" && faulty(t) && a.seq % 2 == 0) a.run = 2;
    return true;
  };
  check_told(third, "channel.IMU.two_publishers", Verdict::kDegraded);
}

TEST_CASE("one restart of a publisher is no second publisher") {
  SmallCar car;
  car.drive(0.0, kFault);
  car.run = 2;
  CHECK(car.reported("channel.IMU.two_publishers", kFault, kMended) < 0.0);
  CHECK(car.health.verdict() == Verdict::kOk);
  CHECK(car.health.report().processes.front().restarts == 1);
}

TEST_CASE("a dead process is told by its silence, a stopped one by its word") {
  SmallCar car;
  car.process = [](double t) { return !faulty(t); };
  car.drive(0.0, kFault);
  const double reported = car.reported("process.imm_fusion.silent", kFault, kMended);
  CHECK(reported > kFault);
  CHECK(reported < kFault + 2.0);  // it beats once a second, the last time at 9 s
}

TEST_CASE("a process that beats fast is missed soon, a slow one later, a restart is told") {
  for (const int64_t period_us : {250'000, 1'000'000}) {
    ProcessMonitor monitor("recorder", ProcessLimits{});
    const auto reported = [&](int64_t now_us) {
      std::vector<Condition> conditions;
      monitor.check(now_us, 0, conditions);
      return conditions.empty() ? "" : conditions.front().key;
    };
    HeartbeatFacts beat;
    beat.run = 1;
    beat.state = ProcessState::kRunning;
    int64_t last_us = 0;
    for (int i = 0; i < 20; ++i) monitor.heartbeat(last_us = test::at(0.0) + i * period_us, beat);
    CHECK(reported(last_us + 5 * period_us / 2 - 1) == "");
    CHECK(reported(last_us + 5 * period_us / 2 + 1) == "process.recorder.silent");
    beat.run = 2;
    monitor.heartbeat(last_us += 3 * period_us, beat);
    CHECK(reported(last_us + 100'000) == "process.recorder.restarted");
    CHECK(reported(last_us + 1'100'000) == "");
  }
}

TEST_CASE("what a heartbeat says of its process: state, processor, memory, queue, lost datagrams") {
  const ProcessLimits limits;
  const auto reported = [&](const std::function<void(HeartbeatFacts&)>& change) {
    ProcessMonitor monitor("imm_fusion", limits, true);
    HeartbeatFacts beat;
    beat.run = 1;
    beat.state = ProcessState::kRunning;
    beat.cpu_share = 0.9 * limits.cpu_share;
    beat.rss_bytes = 100 << 20;
    beat.queue_age_s = 0.9 * limits.queue_age;
    beat.kernel_drops = 5;  // before the monitor listened
    monitor.heartbeat(test::at(0.0), beat);
    change(beat);
    monitor.heartbeat(test::at(1.0), beat);
    std::vector<Condition> conditions;
    monitor.check(test::at(1.1), 0, conditions);
    std::string all;
    for (const Condition& c : conditions) all += c.key + ": " + c.text + "\n";
    return all;
  };
  CHECK(reported([](HeartbeatFacts&) {}).empty());
  CHECK(reported([](HeartbeatFacts& b) { b.cpu_share = 0.97; }) ==
        "process.imm_fusion.cpu: imm_fusion takes 97 % of a processor core\n");
  CHECK(reported([](HeartbeatFacts& b) { b.rss_bytes = int64_t{5} << 30; }) ==
        "process.imm_fusion.memory: imm_fusion holds 5120 MiB\n");
  CHECK(reported([](HeartbeatFacts& b) {
          b.queue_age_s = 0.7;
          b.queue_channel = "POSE_VO";
        }) == "process.imm_fusion.behind: imm_fusion is behind: POSE_VO waits 0.7 s for it\n");
  CHECK(reported([](HeartbeatFacts& b) { b.kernel_drops = 12; }) ==
        "process.imm_fusion.kernel_drops: imm_fusion lost 7 datagrams: the kernel had no room for them\n");
  CHECK(reported([](HeartbeatFacts& b) {
          b.state = ProcessState::kNoClock;
          b.reason = "no newer sample on POSE_INS";
        }) == "process.imm_fusion.no_clock: imm_fusion stands still: no newer sample on POSE_INS\n");
  CHECK(reported([](HeartbeatFacts& b) {
          b.state = ProcessState::kDegraded;
          b.reason = "the network did not take 7 messages";
        }) == "process.imm_fusion.degraded: imm_fusion says: the network did not take 7 messages\n");
}

TEST_CASE("what spoke only once, as a forger does, is not missed for good, what is expected is") {
  for (const bool expected : {false, true}) {
    ProcessMonitor monitor("vo_tracker", ProcessLimits{}, expected);
    for (const double t : {0.0, 0.01, 0.02, 0.03}) monitor.heartbeat(test::at(t), {});
    std::vector<Condition> conditions;
    monitor.check(test::at(20.0), 0, conditions);
    CHECK(conditions.size() == (expected ? 1 : 0));
  }
  ChannelMonitor monitor("CAMERA_LEFT", ChannelLimits{}, std::nullopt);
  const auto late = [&](double now_s) {
    std::vector<Condition> conditions;
    monitor.check(test::at(now_s), 0, 0, Verdict::kDegraded, conditions);
    return !conditions.empty();
  };
  monitor.arrived({test::at(10.0), test::at(-3600.0), 1, 1, 100, std::nullopt});
  CHECK(late(10.5));
  CHECK_FALSE(late(11.5));
}

TEST_CASE("a slow sensor is missed soon after it was due, unless it comes irregularly") {
  for (const int64_t scatter_us : {0, 200'000}) {
    ChannelMonitor monitor("GNSS", ChannelLimits{}, 1.0);
    const auto silent = [&](int64_t now_us) {
      std::vector<Condition> conditions;
      monitor.check(now_us, 0, 0, Verdict::kDegraded, conditions);
      return !conditions.empty() && conditions.front().key == "channel.GNSS.silent";
    };
    int64_t now_us = 0;
    for (int i = 0; i < 20; ++i) {
      now_us = test::at(i) + (i % 2) * scatter_us;
      monitor.arrived({now_us, test::at(i), 1, i, 100, std::nullopt});
    }
    CHECK_FALSE(silent(now_us + 1'250'000));
    CHECK(silent(now_us + 1'350'000) == (scatter_us == 0));
    CHECK(silent(now_us + 1'700'000));
  }
}

TEST_CASE("measurements refused one and all are told before they are most of the window") {
  SmallCar car;
  car.tick = [&](double t) {
    if (std::lround(t * 100) % 20 == 0)
      car.health.measurement("GNSS position in INS", test::at(t), faulty(t) ? 30.0 : 1.0, 3, !faulty(t));
  };
  check_told(car, "refused.GNSS position in INS", Verdict::kDegraded);
  SmallCar single;
  single.tick = [&](double t) {
    if (std::lround(t * 100) % 20 == 0) {
      single.health.measurement("GNSS position in INS", test::at(t), 30.0, 3, t < kFault || t > kFault + 0.35);
    }
  };
  CHECK(single.reported("refused.GNSS position in INS", 0.0, kMended) < 0.0);  // two in a row are none yet

  // A fast source: a quarter of a second of refusals is told, a fifth is a pothole.
  for (const double refused_s : {0.2, 0.4}) {
    SmallCar fast;
    fast.tick = [&](double t) {
      if (std::lround(t * 100) % 5 == 0) {
        fast.health.measurement("Wheel speed in INS", test::at(t), 4.0, 1, t < kFault || t > kFault + refused_s);
      }
    };
    fast.drive(0.0, kFault);
    const double reported = fast.reported("refused.Wheel speed in INS", kFault, kMended);
    CHECK((reported > 0.0) == (refused_s > 0.3));
    CHECK(reported < kFault + 0.5);
  }
}

TEST_CASE("what is expected and never comes is named, unexpected absence is not") {
  Expectations expectations;
  expectations.channels = {{"CAMERA_LEFT", 20.0}};
  expectations.processes = {"vo_tracker"};
  SmallCar car(expectations);
  car.drive(0.0, kFault);
  CHECK_THAT(car.reasons(), Catch::Contains("CAMERA_LEFT has not been heard at all (20 per second expected)"));
  CHECK_THAT(car.reasons(), Catch::Contains("vo_tracker has shown no sign of life"));
  CHECK(car.health.verdict() == Verdict::kDegraded);
}

TEST_CASE("without any estimate: do not use, from the first decision on") {
  SmallCar car;
  car.arrival = [](const std::string& channel, double, Arrival&) { return !channel.starts_with("POSE_"); };
  car.drive(0.0, 0.5);
  CHECK(car.health.verdict() == Verdict::kDoNotUse);
  CHECK_THAT(car.reasons(), Catch::Contains("nobody publishes POSE_FUSED or POSE_INS"));
}

TEST_CASE("disk, clock, the monitor's own losses") {
  SmallCar car;
  HostFacts host;
  car.tick = [&](double t) {
    host.free_disk_gib = faulty(t) ? 0.5 : 50.0;
    host.clock_step_s = faulty(t) ? -3.2 : 0.0;
    host.kernel_drops += faulty(t) ? 1 : 0;
    car.health.host(test::at(t), host);
  };
  check_told(car, "host.disk", Verdict::kDegraded);
  CHECK(car.reported("host.clock", 30.0, 31.0) < 0.0);
  SmallCar again;
  again.tick = [&](double t) {
    host.clock_step_s = faulty(t) ? -3.2 : 0.0;
    again.health.host(test::at(t), host);
  };
  check_told(again, "host.clock", Verdict::kDegraded);
}

TEST_CASE("the same drive gives the same reports") {
  const auto run = [] {
    SmallCar car;
    std::string all;
    car.arrival = [](const std::string& channel, double t, Arrival& a) {
      return !(channel == "GNSS" && faulty(t)) && a.seq % 97 != 0;
    };
    car.drive(0.0, 20.0, [&](double) { all += car.reasons(); });
    return all;
  };
  const std::string once = run();
  CHECK(once == run());
  CHECK_FALSE(once.empty());
}
