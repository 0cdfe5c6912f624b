// A car on a straight road as the monitor sees it: IMU 100 Hz, GNSS 4 Hz, two estimates, one process. Each test breaks
// one thing and looks when the verdict follows.
#pragma once

#include <cmath>
#include <functional>
#include <string>

#include "health/health.h"

namespace roadfix::test {

constexpr int64_t kStart_us = 1'700'000'000'000'000;
constexpr double kSpeed = 15.0;

inline int64_t at(double s) { return kStart_us + std::llround(s * 1e6); }

struct SmallCar {
  Health health;
  /// What happens to a message: false: it is not delivered. May change it.
  std::function<bool(const std::string& channel, double t, Arrival& arrival)> arrival = [](auto&&...) { return true; };
  std::function<void(const std::string& channel, double t, PoseFacts& facts)> pose = [](auto&&...) {};
  std::function<bool(double t)> process = [](double) { return true; };
  std::function<void(double t)> tick = [](double) {};  ///< every 10 ms, for what else happens
  int64_t lag_us = 0;                                  ///< the stamps are this old
  int64_t run = 1;

  explicit SmallCar(const Expectations& expectations = {}, const HealthConfig& config = {})
      : health(config, expectations) {}

  void send(const std::string& channel, double t, int64_t seq) {
    Arrival a;
    a.now_us = at(t);
    a.utime = at(t) - 2000 - lag_us;
    a.run = run;
    a.seq = seq;
    a.content = static_cast<uint64_t>(seq);
    if (!arrival(channel, t, a)) return;
    health.arrived(channel, a);
    if (!channel.starts_with("POSE_")) return;
    PoseFacts facts;
    facts.anchor = Geodetic{0.8, 0.2, 100.0};
    facts.odometry.t_us = a.utime;
    facts.odometry.T_frame_vehicle.p = {kSpeed * t, 0.0, 0.0};
    facts.odometry.velocity = {kSpeed, 0.0, 0.0};
    facts.odometry.cov_pose = Matrix6d::Identity() * 1e-4;
    facts.odometry.validity = Validity::kValid;
    facts.run = a.run;
    pose(channel, t, facts);
    health.pose(channel, a.now_us, facts);
  }

  /// Until `to` seconds; `monitor` sees every decision.
  void drive(
      double from, double to, const std::function<void(double t)>& monitor = [](double) {}) {
    for (int i = static_cast<int>(std::lround(from * 100)); i < std::lround(to * 100); ++i) {
      const double t = i * 0.01;
      while (const auto due = health.next_decision(at(t))) {
        health.decide(*due);
        monitor(t);
      }
      tick(t);
      send("IMU", t, i);
      if (i % 25 == 0) send("GNSS", t, i / 25);
      send("POSE_INS", t, i);
      send("POSE_FUSED", t, i);
      if (i % 100 == 0 && process(t)) {
        HeartbeatFacts beat;
        beat.run = run;
        beat.state = ProcessState::kRunning;
        health.heartbeat("imm_fusion", at(t), beat);
      }
    }
  }

  /// When a reason with this key first stood among the reasons in [from, to); negative: never.
  double reported(const std::string& key, double from, double to) {
    double when = -1.0;
    drive(from, to, [&](double t) {
      for (const Condition& reason : health.report().reasons) {
        if (reason.key == key && when < 0.0) when = t;
      }
    });
    return when;
  }

  [[nodiscard]] std::string reasons() const {
    std::string all;
    for (const Condition& reason : health.report().reasons) all += reason.key + ": " + reason.text + "\n";
    return all;
  }
};

}  // namespace roadfix::test
