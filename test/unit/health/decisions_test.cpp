// When the monitor decides, and what it counts.
#include <catch2/catch.hpp>

#include "small_car.h"

using namespace roadfix;

TEST_CASE("decisions lie on tenths of a second that are over, each once, however seldom the clock is looked at") {
  Health health(HealthConfig{}, Expectations{});
  std::optional<int64_t> last;
  for (double t = 0.037; t < 20.0; t += t < 10.0 ? 0.013 : 0.57) {
    while (const auto due = health.next_decision(test::at(t))) {
      CHECK(*due <= test::at(t));
      CHECK(*due % 100'000 == 0);
      CHECK(*due == last.value_or(*due - 100'000) + 100'000);
      last = *due;
      health.decide(*due);
    }
    if (last) CHECK(test::at(t) - *last < 100'000);
  }
  CHECK(last);
}

TEST_CASE("the rate of a channel is that of its messages, and nought once it is silent") {
  ChannelMonitor monitor("GNSS", ChannelLimits{}, 10.0);
  CHECK(monitor.report(test::at(0.0), 0).rate_hz == 0.0);
  for (int i = 0; i < 50; ++i) monitor.arrived({test::at(0.1 * i), test::at(0.1 * i), 1, i, 100, std::nullopt});
  CHECK(monitor.report(test::at(4.95), 0).rate_hz == Approx(10.0).epsilon(0.02));
  CHECK(monitor.report(test::at(9.0), 0).rate_hz == 0.0);
}

TEST_CASE("two processes under one name are told from a restart, monitors may look side by side") {
  const auto reported = [](const std::string& process, int both) {
    Health health(HealthConfig{}, Expectations{});
    std::string all;
    HeartbeatFacts beat;
    beat.state = ProcessState::kRunning;
    for (int i = 0; i < 100; ++i) {
      const double t = 0.1 * i;
      beat.run = i < 30 ? 1 : 2;
      if (i % 10 == 0) health.heartbeat(process, test::at(t), beat);
      beat.run = 1;
      if (i % 10 == 5 && i >= 30 && i < both) health.heartbeat(process, test::at(t), beat);  // the older one lives on
      while (const auto due = health.next_decision(test::at(t))) health.decide(*due);
      for (const Condition& reason : health.report().reasons) {
        if (reason.key.starts_with("process.") && all.find(reason.text) == std::string::npos) all += reason.text + "\n";
      }
    }
    return all;
  };
  CHECK(reported("gnss_ins_ekf", 30) == "gnss_ins_ekf was started anew\n");
  CHECK(reported("gnss_ins_ekf", 100) ==
        "gnss_ins_ekf was started anew\ngnss_ins_ekf runs twice at once: end one of the two\n");
  CHECK(reported("monitor", 100).empty());
}
