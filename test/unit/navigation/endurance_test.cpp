// Three hours in one run, and wheels whose direction is known in one way or another.
#include <catch2/catch.hpp>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr int kMinutes = 3 * 60;
constexpr int64_t kMinute_us = 60'000'000;

/// The same minute of standing, so many minutes later.
navtest::Samples later(navtest::Samples s, int minutes) {
  for (ImuSample& imu : s.imu) imu.t_us += minutes * kMinute_us;
  for (GnssFix& fix : s.gnss) fix.t_us += minutes * kMinute_us;
  for (WheelSample& wheels : s.wheels) wheels.t_us += minutes * kMinute_us;
  return s;
}

bool sound(const Eigen::MatrixXd& P) {
  const Eigen::MatrixXd floor = 1e-15 * Eigen::MatrixXd::Identity(P.rows(), P.cols());
  return P == P.transpose() && (P + floor).llt().info() == Eigen::Success;
}

Eigen::MatrixXd covariance_of(const Navigation& filter) {
  const State& state = filter.filter()->state();
  return state.P().topLeftCorner(state.size(), state.size());
}

struct Parked {
  double horizontal = 0.0, sigma = 0.0;  ///< m, at the end
};

/// Into a car park, a minute without GNSS and out backwards; `relabel` changes the wheel samples.
Parked park(WheelSigns signs, const std::function<void(WheelSample&)>& relabel) {
  ScenarioConfig s = scenario("car_park");
  s.wheels.signs = signs;
  const SimulatedDrive drive = simulate(s, 5);
  navtest::Samples samples(drive);
  for (WheelSample& wheels : samples.wheels) relabel(wheels);
  const int64_t end = samples.imu.back().t_us;
  std::erase_if(samples.gnss, [&](const GnssFix& fix) { return fix.t_us > end - 60'000'000; });
  Navigation filter(navtest::filter_config(s));
  navtest::run(filter, samples, [](Navigation& f, int64_t) { f.clear_records(); });
  const Odometry o = filter.output().imu;
  return {navtest::error_of(filter, o, drive).head<2>().norm(), std::sqrt(o.cov_pose.topLeftCorner<2, 2>().trace())};
}

}  // namespace

TEST_CASE("after three hours the covariance is symmetric, positive and as small as after an hour") {
  ScenarioConfig s = scenario("city_loop");
  s.motion.route = RouteKind::kStanding;
  s.duration_s = 60.0;
  s.imu.rate_hz = 10.0;
  s.gnss.rate_hz = 0.2;
  s.wheels.rate_hz = 1.0;
  const navtest::Samples minute(simulate(s, 4));
  Navigation filter(navtest::filter_config(s));
  Eigen::MatrixXd hour, night;
  for (int i = 0; i < kMinutes; ++i) {
    navtest::Samples now = later(minute, i);
    if (i > kMinutes / 2) now.gnss.clear();  // the second half in a garage
    navtest::run(filter, now, [](Navigation& f, int64_t) { f.clear_records(); });
    REQUIRE(filter.filter() != nullptr);
    if (i == 60) hour = covariance_of(filter);
    if (i == kMinutes / 2) night = covariance_of(filter);
    if (i % 60 == 0) REQUIRE(sound(covariance_of(filter)));
  }
  REQUIRE(filter.output().odometry.T_frame_vehicle.p.allFinite());
  CHECK(filter.output().odometry.cov_pose.diagonal().minCoeff() > 0.0);
  CHECK(night.diagonal().head<3>().maxCoeff() < 4.0 * hour.diagonal().head<3>().maxCoeff());
  // Teeth: a covariance that lost its symmetry in the last bit, and one with a negative variance.
  Eigen::MatrixXd P = covariance_of(filter);
  P(0, 1) = std::nextafter(P(0, 1), 1.0);
  CHECK_FALSE(sound(P));
  P = covariance_of(filter);
  P(2, 2) = -P(2, 2);
  CHECK_FALSE(sound(P));
}

TEST_CASE("reversing is followed by wheels that are signed, told by the gear, or have no sign at all") {
  for (const WheelSigns signs : {WheelSigns::kSigned, WheelSigns::kGear, WheelSigns::kUnsigned}) {
    CAPTURE(signs);
    const Parked p = park(signs, [](WheelSample&) {});
    CHECK(p.horizontal < 0.3);
    CHECK(p.horizontal < 4.0 * p.sigma);
  }
  // Teeth: a gear that always says forward.
  const double told = park(WheelSigns::kGear, [](WheelSample&) {}).horizontal;
  CHECK(park(WheelSigns::kGear, [](WheelSample& w) { w.direction = WheelDirection::kForward; }).horizontal >
        2.0 * told);
}
