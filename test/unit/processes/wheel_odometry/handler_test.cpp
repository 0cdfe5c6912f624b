#include "wheel_odometry/handler.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/run/stage_runner.h"
#include "bus/types/message.h"
#include "simulation/scenarios.h"
#include "simulation/simulate.h"

namespace roadfix {
namespace {

struct Arrival {
  int64_t at_us = 0;
  int input = 0;
  std::vector<uint8_t> bytes;
};

/// Messages of a simulated drive in the order of arrival, wheels late by up to `late_us`.
std::vector<Arrival> arrivals(const SimulatedDrive& drive, int64_t late_us) {
  std::vector<Arrival> all;
  int64_t seq = 0;
  for (const ImuSample& s : drive.imu) {
    imu_t m{};
    m.utime = s.t_us;
    m.run = 1;
    m.seq = seq++;
    std::copy(s.gyro.data(), s.gyro.data() + 3, m.gyro_radps);
    std::copy(s.accel.data(), s.accel.data() + 3, m.accel_mps2);
    all.push_back({s.t_us, 0, encode(m)});
  }
  seq = 0;
  for (const WheelSample& s : drive.wheels) {
    wheels_t m{};
    m.utime = s.t_us;
    m.run = 1;
    m.seq = seq++;
    m.direction = wheels_t::DIRECTION_SIGNED;
    m.num_speeds = static_cast<int8_t>(s.num_speeds);
    std::copy(s.speeds.begin(), s.speeds.end(), m.speed_mps);
    all.push_back({s.t_us + (seq % 3) * late_us / 3, 1, encode(m)});
  }
  std::stable_sort(all.begin(), all.end(), [](const Arrival& a, const Arrival& b) { return a.at_us < b.at_us; });
  return all;
}

class Collector final : public MessageSink {
 public:
  void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
    if (channel == "POSE_WHEEL") poses.emplace_back(bytes.begin(), bytes.end());
  }
  std::vector<std::vector<uint8_t>> poses;
};

SimulatedDrive drive() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 20.0;
  return simulate(s, 1);
}

Calibration calibration() {
  Calibration c;
  c.body_origin = BodyOrigin::kRearAxle;
  c.sensors.wheels = WheelsCalibration{};
  c.sensors.wheels->track_width = 1.55;
  return c;
}

std::vector<std::vector<uint8_t>> run(const std::vector<Arrival>& messages) {
  Collector sink;
  StageRunner runner(make_wheel_odometry(calibration(), {}), sink);
  for (const Arrival& a : messages) runner.offer(a.input, a.bytes);
  return sink.poses;
}

TEST_CASE("the stage publishes poses at the newest clock sample") {
  const SimulatedDrive d = drive();
  const auto poses = run(arrivals(d, 0));
  REQUIRE(poses.size() > 900);
  const pose_t last = decode<pose_t>(poses.back());
  CHECK(d.imu.back().t_us - last.utime < 20'000);
  CHECK(last.validity == pose_t::VALIDITY_VALID);
  CHECK(last.frame == pose_t::FRAME_LOCAL);
  CHECK(last.origin == pose_t::ORIGIN_REAR_AXLE);
  CHECK(last.velocity_mps[0] == Approx(d.truth_at(last.utime).velocity.x()).margin(0.5));
  CHECK(decode<pose_t>(poses.front()).validity == pose_t::VALIDITY_INVALID);
  CHECK(!decode<pose_t>(poses.front()).reason.empty());
}

TEST_CASE("late wheel samples give the same bits") {
  const SimulatedDrive d = drive();
  const auto in_order = run(arrivals(d, 0));
  CHECK(in_order == run(arrivals(d, 45'000)));
  CHECK(in_order == run(arrivals(d, 0)));
  CHECK(in_order != run(arrivals(d, 200'000)));  // beyond the lateness they are refused and the result differs
}

TEST_CASE("a snapshot restored mid-drive continues with the same bits") {
  const SimulatedDrive d = drive();
  auto stage = make_wheel_odometry(calibration(), {});
  auto resumed = make_wheel_odometry(calibration(), {});
  const std::vector<Arrival> messages = arrivals(d, 0);
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const Arrival& a = messages[i];
    const Header h = *read_header(a.bytes);
    const Message m{a.input, h.utime, h.run, h.seq, a.bytes};
    stage->apply(m);
    if (i == messages.size() / 2) {
      resumed->load(stage->save());
    } else if (i > messages.size() / 2) {
      resumed->apply(m);
    }
  }
  Digest one, two;
  stage->digest(one);
  resumed->digest(two);
  CHECK(one.value() == two.value());
  CHECK_THROWS(resumed->load(std::vector<uint8_t>{1, 2, 3}));
}

TEST_CASE("calibration values reach the odometry, missing ones keep the default") {
  Calibration c = calibration();
  c.sensors.imu = ImuCalibration{};
  c.sensors.imu->gyro_noise = 7e-4;
  c.sensors.imu->gyro_bias_std = 1e-3;
  c.sensors.imu->correlation = 200.0;
  const WheelSensors s = wheel_sensors(c);
  CHECK(s.gyro_noise == 7e-4);
  CHECK(s.gyro_bias_walk == Approx(1e-4));
  c.sensors.imu->accel_bias_std = 1e-2;
  CHECK(wheel_sensors(c).accel_bias_walk == Approx(1e-3));
  c.sensors.imu->accel_correlation = 20'000.0;
  CHECK(wheel_sensors(c).accel_bias_walk == Approx(1e-4));
  CHECK(wheel_sensors(c).gyro_bias_walk == Approx(1e-4));
  CHECK(s.accel_noise == WheelSensors{}.accel_noise);
  CHECK(*s.track_width == 1.55);
}

}  // namespace
}  // namespace roadfix
