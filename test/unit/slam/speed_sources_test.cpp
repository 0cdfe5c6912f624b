/// Two sources of scale: wheels with a scale error at once, an INS with the right scale half a second late.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "fed_tracker.h"
#include "slam/distance_history.h"

namespace roadfix {
namespace {

constexpr int64_t kLate_us = 500'000;
constexpr double kShort = 0.985;  ///< scale of the wheel speeds

/// Wheels and an INS at `speed` until the twentieth second; the INS has the relative sigma `ins_scale`.
std::optional<TravelledDistance> newest_way(double speed, double ins_scale) {
  constexpr int64_t kEnd_us = 20'000'000;
  DistanceHistory wheels, ins;
  for (int64_t t_us = 0; t_us <= kEnd_us; t_us += 50'000) {
    wheels.add({t_us, SpeedSource::kWheels, kShort * speed, 0.03, 0.01});
    if (t_us <= kEnd_us - kLate_us) ins.add({t_us, SpeedSource::kIns, speed, ins_scale * speed, ins_scale});
  }
  return rescaled_distance(ins, wheels, kEnd_us - 100'000, kEnd_us);
}

TEST_CASE("recent wheel distances are rescaled to a later INS") {
  const auto way = newest_way(14.0, 0.002);
  REQUIRE(way);
  CHECK(way->distance == Approx(1.4).epsilon(1e-6));
  CHECK(way->scale_std > 0.002);
  CHECK(way->scale_std < 0.0025);
  CHECK(way->sigma < 0.01);  // with the wheels' noise; extrapolating the INS would be less accurate
}

TEST_CASE("wheels keep their own scale when the INS is less certain, and at a standstill") {
  CHECK_FALSE(newest_way(14.0, 0.02));
  CHECK_FALSE(newest_way(1e-4, 0.002));
  CHECK_FALSE(rescaled_distance({}, {}, 0, 1));
}

/// The monocular result of a drive with such speeds.
struct Learnt {
  double length = 0.0;  ///< logarithm of the estimated over the true distance
  double radial = 0.0;
};

Learnt drive(uint64_t seed, bool with_ins) {
  const test::TrackDrive d = test::patches_of_one_eye("demo", 40.0, seed);
  KeyframeTrackerConfig config;
  config.close_loops = false;
  test::FedTracker tracker(config, d.drive.config, false);
  size_t next = 0;
  double way = 0.0, true_way = 0.0;
  std::optional<std::pair<SE3, SE3>> before;
  for (const auto& event : d.events) {
    if (const auto* w = std::get_if<WheelSample>(&event)) {
      const double speed = kShort * d.drive.truth_at(w->t_us).velocity.x();
      tracker->speed({w->t_us, SpeedSource::kWheels, speed, 0.03, 0.01});
    }
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    for (; with_ins && next < d.drive.imu.size() && d.drive.imu[next].t_us + kLate_us <= frame->t_us; ++next) {
      const int64_t t_us = d.drive.imu[next].t_us;
      const double speed = d.drive.truth_at(t_us).velocity.x();
      tracker->speed({t_us, SpeedSource::kIns, speed, 0.03, 0.03 / std::max(1.0, speed)});
    }
    const TrackedFrame& out = tracker.process(frame->t_us, frame->tracks);
    const SE3 now = out.odometry.T_frame_vehicle, truth = d.truth(*frame).T_frame_vehicle;
    if (out.odometry.validity != Validity::kValid || out.scale == ScaleSource::kNone) continue;
    if (before && out.reset_delta.p.isZero()) {
      way += (now.p - before->first.p).norm();
      true_way += (truth.p - before->second.p).norm();
    }
    before = {now, truth};
  }
  REQUIRE(true_way > 200.0);
  return {std::log(way / true_way), tracker->lens().value(LensCorrection::kRadial)};
}

TEST_CASE("two sources with different scales distort neither scale nor lens", "[statistics]") {
  constexpr int kSeeds = 3;
  double length = 0.0, radial = 0.0, wheels = 0.0;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Learnt both = drive(seed, true);
    length += both.length / kSeeds;
    radial += both.radial / kSeeds;
    wheels += drive(seed, false).length / kSeeds;
  }
  std::printf("wheels 1.5 %% short, INS late: length %+.3f %%, radial %+.2e; wheels alone %+.3f %%\n", 100.0 * length,
              radial, 100.0 * wheels);
  CHECK(std::abs(length) < 0.001);
  CHECK(std::abs(radial) < 0.0015);
  CHECK(wheels < -0.01);  // teeth: the scale error of the wheels alone
}

}  // namespace
}  // namespace roadfix
