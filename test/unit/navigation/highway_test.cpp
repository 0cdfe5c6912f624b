// Three minutes of highway, one camera and an imu, tracks without pixels: hardly any parallax, hardly any turn, speed
// constant. And a minute of constant speed before a turn. The drift stays inside its own three sigma, and below a
// hundredth of the way.
#include <catch2/catch.hpp>

#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr int kEvery = 1000;  // samples of the imu, ten seconds
constexpr double kSigmas = 3.0;
/// Of the values on the way: 0.003 where white, but one excursion counts for half a minute.
constexpr double kMostOutside = 0.02;
constexpr double kMostDrift = 0.01;   // of the way
constexpr double kFirstWay = 1000.0;  // m, before which a share says little: the start alone is off by metres

struct Drift {
  double sigmas = 0.0;          ///< largest of an axis of the position, at the end
  int values = 0, outside = 0;  ///< of every axis on the way, and those beyond three sigma
  double share = 0.0;           ///< largest error over way
  double end = 0.0, way = 0.0, sigma = 0.0;
  int resets = 0, invalid = 0;
};

Drift drive(uint64_t seed, double accel_gain) {
  test::VisualDriveConfig car = test::highway_drive(180.0);
  car.tracks.wanted = 100;
  test::VisualDrive d = test::make_drive(car, seed);
  for (ImuSample& s : d.drive.imu) s.accel.head<2>() *= accel_gain;
  navigation::Navigation filter(test::filter_config(car));
  Drift r;
  Eigen::Vector3d before = d.drive.truth_at(d.drive.imu.front().t_us).T_frame_vehicle.p;
  int samples = 0;
  bool begun = false;
  test::run(filter, d, false, [&](navigation::Navigation& f) {
    begun = begun || f.filter() != nullptr;
    r.invalid += begun && f.filter() == nullptr ? 1 : 0;
    if (++samples % kEvery != 0) return;
    const navigation::NavigationOutput o = f.output();
    const Eigen::Vector3d p = d.drive.truth_at(o.odometry.t_us).T_frame_vehicle.p;
    r.way += (p - before).norm();  // long curves: a chord of ten seconds is the way but for a thousandth
    before = p;
    const Eigen::Vector3d e = test::error_of(o.imu, d).head<3>();
    const Eigen::Vector3d std = o.odometry.cov_pose.diagonal().head<3>().cwiseSqrt();
    const Eigen::Vector3d sigmas = e.cwiseQuotient(std).cwiseAbs();
    r.sigmas = sigmas.maxCoeff();
    r.values += 3;
    r.outside += static_cast<int>((sigmas.array() > kSigmas).count());
    r.end = e.norm();
    r.sigma = std.norm();
    if (r.way > kFirstWay) r.share = std::max(r.share, r.end / r.way);
    r.resets = o.reset_counter;
    r.invalid += o.odometry.validity == Validity::kInvalid ? 1 : 0;
  });
  std::printf(
      "highway, seed %d, accelerometer x %.2f: %.1f m off after %.0f m (sigma %.1f, an axis %.2f; %d of %d beyond 3), "
      "%.2f %%\n",
      static_cast<int>(seed), accel_gain, r.end, r.way, r.sigma, r.sigmas, r.outside, r.values, 100.0 * r.share);
  return r;
}

/// Samples after the first valid pose at which it is not, and resets.
int not_valid(const test::VisualDriveConfig& car, const test::VisualDrive& d) {
  navigation::Navigation filter(test::filter_config(car));
  int count = 0;
  bool begun = false;
  test::run(filter, d, false, [&](navigation::Navigation& f) {
    const navigation::NavigationOutput o = f.output();
    const bool valid = o.odometry.validity == Validity::kValid;
    begun = begun || valid;
    count += begun && !valid ? 1 : 0;
  });
  CHECK(begun);
  return count + filter.output().reset_counter;
}

}  // namespace

TEST_CASE("a minute of constant speed and a right angle: no pose is lost, and undeclared darkness would show") {
  test::VisualDriveConfig car = test::turn_drive();
  car.tracks.wanted = 100;
  test::VisualDrive d = test::make_drive(car, 1);
  CHECK(not_valid(car, d) == 0);
  const int64_t dark_us = d.drive.imu.front().t_us + 20'000'000;
  for (TrackPicture& frame : d.frames)
    if (frame.t_us > dark_us && frame.t_us < dark_us + 3'000'000) frame.tracks.clear();
  d.drive.imu.resize(d.drive.imu.size() / 3);
  CHECK(not_valid(car, d) > 0);
}

TEST_CASE("on a highway the drift is inside its own three sigma and at most one percent of the way") {
  int values = 0, outside = 0;
  for (const uint64_t seed : {1U, 2U, 3U}) {
    const Drift r = drive(seed, 1.0);
    CHECK(r.resets == 0);
    CHECK(r.invalid == 0);
    CHECK(r.way > 4500.0);
    CHECK(r.sigmas < kSigmas);
    CHECK(r.share < kMostDrift);
    values += r.values;
    outside += r.outside;
  }
  CHECK(outside < kMostOutside * values);
}

TEST_CASE("the highway test sees an accelerometer whose scale is wrong by more than it is told") {
  const Drift r = drive(1, 1.03);
  CHECK(r.sigmas > kSigmas);
  CHECK(r.outside > kMostOutside * r.values);
  CHECK(r.share > kMostDrift);
}
