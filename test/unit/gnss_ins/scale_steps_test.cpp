// Steps of the wheels' scale: what they make of the filter, and whole drives in which they come.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"
#include "gnss_ins/refused_wheels.h"
#include "random_state.h"

using namespace roadfix;

namespace {

/// A second of driving with wheel speeds and the constraint, a fix in its middle; the estimate of the scale is off by
/// `step` from the beginning.
InsCore driven(double step, bool wheels) {
  GnssInsConfig config;
  config.vehicle.p_imu_axle_std = Eigen::Vector3d::Constant(0.3);
  NavState x;
  x.velocity = {12.0, 0.0, 0.0};
  x.wheel_scale = step;
  ErrorVector sigmas = ErrorVector::Constant(1e-3);
  sigmas.segment<6>(kPos).setConstant(0.1);
  InsCore core(config, Geodetic{0.8, 0.2, 500.0});
  core.initialise(x, ErrorMatrix(sigmas.cwiseAbs2().asDiagonal()));
  core.follow_scale_steps();
  for (int k = 1; k <= 100; ++k) {
    ImuSample imu;
    imu.t_us = 10'000 * k;
    imu.gyro = {0.0, 0.0, 0.2};
    imu.accel = {0.5, 2.4, 9.81};
    core.predict(imu, 0.01, {1e-4, 1e-3});
    const auto fuse = [&](AidingSource source, const auto& m) { (void)core.fuse(source, imu.t_us, m, 1e12); };
    if (wheels && k % 10 == 0)
      fuse(AidingSource::kWheelSpeed, wheel_speed(core.state(), core.motion(), 12.0 + 0.005 * k, 0.03, 0.0));
    if (k % 25 == 0) {
      Measurement<2> m = no_sideslip(core.state(), core.motion());
      m.R *= 1e-4;
      fuse(AidingSource::kNoSideslip, m);
    }
    if (k == 50)
      fuse(AidingSource::kGnssPosition,
           gnss_position(core.state(), core.motion(), {6.0, 0.1, 0.0}, 0.01 * Eigen::Matrix3d::Identity(), 0.003));
  }
  return core;
}

}  // namespace

TEST_CASE("what a step of the wheels' scale has made of the filter is what it has made of it") {
  constexpr double kStep = 1e-5;
  // A true scale that is larger is an estimate that is smaller.
  const InsCore up = driven(kStep, true), down = driven(-kStep, true), unused = driven(0.0, false);
  const InsCore core = driven(0.0, true);
  const ErrorVector expected = local(down.state(), up.state()) / (2.0 * kStep);
  const ErrorVector found = core.scale_steps().most_likely(0.0)->per_unit;
  CAPTURE(found.transpose(), expected.transpose());
  CHECK((found - expected).norm() < 5e-3 * expected.norm());
  CHECK(std::abs(found(kVel)) > 1.0);
  // Teeth: without wheels it makes nothing of it.
  CHECK_FALSE(unused.scale_steps().most_likely(0.0).has_value());
}

TEST_CASE("wheel speeds that are refused are asked anew once they were off by one share for long enough") {
  const auto after = [](double share, double turning) {
    RefusedWheels wheels;
    for (int k = 0; k < 100; ++k) {
      const double now = share + turning * (k % 2 == 0 ? 1.0 : -1.0);
      if (wheels.refused(1'000'000 + 100'000 * k, 12.0 * now, 12.0)) return 0.1 * k;
    }
    return -1.0;
  };
  CHECK(after(0.02, 0.002) == Approx(0.5));
  CHECK(after(-0.02, 0.002) == Approx(0.5));
  CHECK(after(0.2, 0.01) >= 5.0);  // may be a wheel that spins
  CHECK(after(-1.0, 0.0) < 0.0);   // one that is locked
  CHECK(after(0.02, 0.04) < 0.0);  // no scale reads now more, now less
}

namespace {

struct Told {
  double honest = 0.0;  ///< error squared over variance, level
  double error = 0.0;   ///< m, root mean square
  int64_t steps = 0;    ///< that were taken back
};

/// The last seconds of a minute of tunnel, over some drives, with wheels that a fault changes.
Told in_tunnel(const char* fault, bool steps) {
  test::LevelScore score;
  int64_t taken_back = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    ScenarioConfig s = scenario("tunnel_dark");
    s.duration_s = 151.0;
    if (fault != nullptr) s.faults.push_back(parse_fault(fault));
    const SimulatedDrive drive = simulate(s, seed);
    GnssInsConfig config = test::filter_config(s);
    config.aiding.use_scale_steps = steps;
    GnssIns filter(config);
    score.run(filter, drive, 140.0, 150.0);
    taken_back += filter.status().wheel_scale_steps;
  }
  return {score.squares / score.variances, std::sqrt(score.squares / score.scored), taken_back};
}

}  // namespace

TEST_CASE("wheels whose scale steps before a tunnel or in it are found out without GNSS") {
  const Told none = in_tunnel(nullptr, true);
  for (const char* fault : {"wheels.scale@85+200:ratio=0.02", "wheels.scale@110+200:ratio=0.02",
                            "wheels.scale@85+200:ratio=0.005", "wheels.scale@110+200:ratio=-0.005"}) {
    const Told told = in_tunnel(fault, true), believed = in_tunnel(fault, false);
    std::printf("%s: %.2f m, square over variance %.2f; believed %.2f m, %.1f; without a step %.2f m, %.2f\n", fault,
                told.error, told.honest, believed.error, believed.honest, none.error, none.honest);
    CHECK(told.honest < 1.5);
    CHECK(told.error < 1.25 * none.error);
    CHECK(told.steps >= 6);        // one in each drive
    CHECK(believed.honest > 2.5);  // teeth
  }
}

TEST_CASE("where no scale steps the wheels are not doubted, also not noisier ones") {
  const Told none = in_tunnel(nullptr, true), unasked = in_tunnel(nullptr, false);
  CHECK(none.error == Approx(unasked.error).epsilon(0.02));
  CHECK(none.steps == 0);
  const Told noisy = in_tunnel("wheels.noise@60+200:factor=2", true);
  CHECK(noisy.honest < 1.25);
}
