// Are the covariances what the errors are? 50 simulated drives; NEES at one late epoch per drive, NIS per source. And
// eighty at the end of a minute of tunnel, where wheels and the no-sideslip constraint are all there is.
#include <catch2/catch.hpp>

#include "filter_run.h"
#include "geometry/so3.h"
#include "statistics/consistency.h"

using namespace roadfix;

namespace {

constexpr int kDrives = 50;
constexpr double kDuration = 107.0;  // s
constexpr double kEpoch = 105.0;     // s

struct Outcome {
  ConsistencyAccumulator position, attitude, velocity, gnss_nis;
  int scored = 0, inside = 0;  // components within three sigma
};

ScenarioConfig drive_config(double noise_factor) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = kDuration;
  s.imu.gyro_noise_radps_per_rthz *= noise_factor;
  s.imu.accel_noise_mps2_per_rthz *= noise_factor;
  s.gnss.sigma_horizontal_m *= noise_factor;
  s.gnss.sigma_up_m *= noise_factor;
  s.gnss.sigma_velocity_mps *= noise_factor;
  s.gnss.claimed_sigma_factor /= noise_factor;
  return s;
}

Outcome drive_all(double noise_factor, const std::function<void(GnssInsConfig&)>& change) {
  const ScenarioConfig truth = drive_config(noise_factor);
  Outcome out;
  for (int seed = 1; seed <= kDrives; ++seed) {
    const SimulatedDrive drive = simulate(truth, static_cast<uint64_t>(seed));
    GnssInsConfig config = test::filter_config(drive_config(1.0));
    change(config);
    GnssIns filter(config);
    bool done = false;
    const int64_t start = drive.imu.front().t_us;
    test::run(filter, test::Samples(drive), [&](GnssIns& f, int64_t now) {
      for (const AidingRecord& r : f.records())
        if (seconds_between(start, now) > 40.0 && r.source == AidingSource::kGnssPosition && r.dof == 3)
          out.gnss_nis.add(r.nis, r.dof);
      f.clear_records();
      if (done || seconds_between(start, now) < kEpoch) return;
      done = true;
      const Odometry o = f.output().odometry;
      if (o.validity == Validity::kInvalid) return;
      const Eigen::Matrix<double, 9, 1> e = test::error_of(f, o, drive);
      const auto add = [&](ConsistencyAccumulator& to, const Eigen::Vector3d& error, const Eigen::Matrix3d& cov) {
        to.add(error.dot(cov.inverse() * error), 3);
        for (int i = 0; i < 3; ++i) out.inside += error(i) * error(i) <= 9.0 * cov(i, i);
        out.scored += 3;
      };
      add(out.position, e.head<3>(), o.cov_pose.topLeftCorner<3, 3>());
      add(out.attitude, e.segment<3>(3), o.cov_pose.bottomRightCorner<3, 3>());
      add(out.velocity, e.tail<3>(), o.cov_velocity);
    });
  }
  return out;
}

double all(const Outcome& o) { return (o.position.ratio() + o.attitude.ratio() + o.velocity.ratio()) / 3.0; }

void print(const char* name, const Outcome& o) {
  std::printf("%s: position %.3f attitude %.3f velocity %.3f (%d drives), NIS %.3f, within 3 sigma %.4f\n", name,
              o.position.ratio(), o.attitude.ratio(), o.velocity.ratio(), o.position.count(), o.gnss_nis.ratio(),
              static_cast<double>(o.inside) / o.scored);
}

}  // namespace

TEST_CASE("NEES and NIS of fifty drives are consistent") {
  const Outcome o = drive_all(1.0, [](GnssInsConfig&) {});
  print("as configured", o);
  CHECK(o.position.count() >= kDrives - 1);
  CHECK(all(o) > 0.84);
  CHECK(all(o) < 1.18);
  CHECK(o.gnss_nis.ratio() > 0.84);
  CHECK(o.gnss_nis.ratio() < 1.18);
  CHECK(o.inside >= 0.99 * o.scored);
}

TEST_CASE("NEES is consistent without the sideslip constraint as well") {
  const Outcome o = drive_all(1.0, [](GnssInsConfig& c) { c.aiding.use_sideslip = false; });
  print("without the constraint", o);
  CHECK(all(o) > 0.84);
  CHECK(all(o) < 1.18);
}

TEST_CASE("noise one and a half times as large stays within three sigma") {
  const Outcome o = drive_all(1.5, [](GnssInsConfig&) {});
  print("noise x 1.5", o);
  CHECK(o.inside >= 0.99 * o.scored);
}

TEST_CASE("the consistency test sees a wrong lever arm") {
  const Outcome o = drive_all(1.0, [](GnssInsConfig& c) { c.vehicle.p_imu_antenna.y() += 0.10; });
  print("lever arm 10 cm off", o);
  CHECK(all(o) > 1.18);
}

TEST_CASE("the consistency test sees a lever arm with its sign wrong") {
  const Outcome o = drive_all(1.0, [](GnssInsConfig& c) { c.vehicle.p_imu_antenna.x() *= -1.0; });
  print("lever arm's x turned round", o);
  CHECK(all(o) > 1.18);
}

TEST_CASE("the consistency test sees too much process noise") {
  const Outcome o = drive_all(1.0, [](GnssInsConfig& c) {
    c.vehicle.gyro_noise *= 4.0;
    c.vehicle.accel_noise *= 4.0;
  });
  print("process noise x 16", o);
  CHECK(all(o) < 0.84);
}

namespace {

constexpr int kTunnels = 80;
constexpr double kTunnelEnd = 149.0;  // s

/// Mean of the squared errors along and across the car and up over their variances, at the tunnel's end.
Eigen::Vector3d tunnel_ratios(const std::function<void(GnssInsConfig&)>& change) {
  ScenarioConfig truth = scenario("tunnel_dark");
  truth.camera.layout = CameraLayout::kNone;
  truth.duration_s = kTunnelEnd + 0.5;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int seed = 1; seed <= kTunnels; ++seed) {
    const SimulatedDrive drive = simulate(truth, static_cast<uint64_t>(seed));
    GnssInsConfig config = test::filter_config(truth);
    change(config);
    GnssIns filter(config);
    bool done = false;
    test::run(filter, test::Samples(drive), [&](GnssIns& f, int64_t now) {
      f.clear_records();
      if (done || seconds_between(drive.imu.front().t_us, now) < kTunnelEnd) return;
      done = true;
      const Odometry o = f.output().odometry;
      const Eigen::Vector3d forward = o.T_frame_vehicle.q * Eigen::Vector3d::UnitX();
      const double level = forward.head<2>().norm();
      const double east = forward.x() / level, north = forward.y() / level;
      Eigen::Matrix3d to_car;
      to_car << east, north, 0.0, -north, east, 0.0, 0.0, 0.0, 1.0;
      const Eigen::Vector3d e = to_car * test::error_of(f, o, drive).head<3>();
      const Eigen::Matrix3d P = to_car * o.cov_pose.topLeftCorner<3, 3>() * to_car.transpose();
      sum += e.cwiseAbs2().cwiseQuotient(P.diagonal());
    });
  }
  return sum / kTunnels;
}

}  // namespace

TEST_CASE("at the end of a tunnel the errors along and across the car and up are as large as is claimed") {
  // Ratios over eighty drives scatter by 0.16.
  const Eigen::Vector3d now = tunnel_ratios([](GnssInsConfig&) {});
  std::printf("at a tunnel's end: along %.2f, across %.2f, up %.2f\n", now.x(), now.y(), now.z());
  CHECK(now.head<2>().minCoeff() > 0.65);
  CHECK(now.maxCoeff() < 1.4);
  CHECK(now.z() > 0.45);
  // Teeth: a wheel scale that is held for exact, wheels that are held for five times as noisy as they are, a gyro that
  // is held for three times as quiet whatever it shows, and roads that are held for far rougher than any.
  CHECK(tunnel_ratios([](GnssInsConfig& c) { c.vehicle.wheel_scale_std = 0.0; }).x() > 1.4);
  CHECK(tunnel_ratios([](GnssInsConfig& c) { c.vehicle.wheel_noise *= 5.0; }).x() < 0.65);
  CHECK(tunnel_ratios([](GnssInsConfig& c) {
          c.vehicle.gyro_noise *= 0.3;
          c.propagation.vibration_factor = 0.3;
        }).y() > 1.4);
  CHECK(tunnel_ratios([](GnssInsConfig& c) {
          c.sideslip.heave_start_std = 0.1;
          c.sideslip.heave_prior_count = 20.0;
        }).z() < 0.45);
}

namespace {

/// Ten car parks, whose turns are tight, with the IMU off the rear axle; by the receiver's velocity the filter would
/// come to doubt wheels that are in another place than it believes.
test::LevelScore off_axle(const char* name, const std::function<void(GnssInsConfig&)>& change) {
  ScenarioConfig truth = scenario("car_park");
  truth.imu.position_m = {0.7, -0.4, 0.8};
  truth.faults.push_back(parse_fault("gnss.no_velocity@0+1000"));
  test::LevelScore score;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    GnssInsConfig config = test::filter_config(truth);
    change(config);
    GnssIns filter(config);
    score.run(filter, simulate(truth, seed), 40.0, truth.duration_s - 1.0);
  }
  std::printf("IMU off the axle, %s: level error squared over variance %.2f, within 3 sigma %.4f\n", name,
              score.squares / score.variances, score.share());
  return score;
}

}  // namespace

TEST_CASE("an IMU off the rear axle is as good as one over it, whether the calibration tells where or not") {
  const test::LevelScore unknown = off_axle("unknown", [](GnssInsConfig&) {});
  const test::LevelScore told = off_axle("told", [](GnssInsConfig& c) {
    c.vehicle.p_imu_axle = {-0.7, 0.4, -0.8};
    c.vehicle.p_imu_axle_std.setConstant(0.05);
  });
  for (const test::LevelScore& score : {unknown, told}) {
    CHECK(score.share() >= 0.98);
    CHECK(score.squares < 1.5 * score.variances);
  }
  // Teeth: a place along the car alone is looked for, and nothing takes the rest for a scale that steps.
  const test::LevelScore wrong = off_axle("called beside it", [](GnssInsConfig& c) {
    c.vehicle.p_imu_axle_std << 1.0, 0.0, 0.0;
    c.aiding.use_scale_steps = false;
  });
  CHECK(wrong.share() < 0.7);
  CHECK(wrong.squares > 4.0 * wrong.variances);
}

TEST_CASE("an antenna that is measured roughly, or not at all, is found") {
  ScenarioConfig truth = scenario("city_loop");
  truth.gnss.lever_arm_std_m = 0.05;
  const auto level = [&](const char* name, const std::function<void(GnssInsVehicle&)>& change) {
    test::LevelScore score;
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      GnssInsConfig config = test::filter_config(truth);
      change(config.vehicle);
      GnssIns filter(config);
      score.run(filter, simulate(truth, seed), 40.0, 120.0);
    }
    std::printf("antenna %s: level error squared over variance %.2f, rms %.3f m, within 3 sigma %.4f\n", name,
                score.squares / score.variances, std::sqrt(score.squares / score.scored), score.share());
    return score;
  };
  const test::LevelScore measured = level("measured", [](GnssInsVehicle& v) { v.p_imu_antenna_std.setConstant(0.05); });
  const test::LevelScore unknown = level("unknown", [](GnssInsVehicle& v) {
    v.p_imu_antenna.setZero();
    v.p_imu_antenna_std << 1.0, 0.5, 1.0;
  });
  for (const test::LevelScore& score : {measured, unknown}) {
    CHECK(score.share() >= 0.98);
    CHECK(score.squares < 1.5 * score.variances);
  }
  // Teeth: called exact, its error is the filter's.
  const test::LevelScore exact = level("called exact", [](GnssInsVehicle&) {});
  CHECK(exact.share() < 0.7);
  CHECK(exact.squares > 1.5 * measured.squares);
}

TEST_CASE("a mounting that the calibration tells is as good as none") {
  ScenarioConfig truth = scenario("city_loop");
  truth.imu.mounting_std_rad.setConstant(0.05);
  test::LevelScore told, untold;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const SimulatedDrive drive = simulate(truth, seed);
    GnssInsConfig config = test::filter_config(truth);
    config.vehicle.mounting_std.setZero();
    config.vehicle.p_imu_antenna = drive.errors.q_vehicle_imu.conjugate() * truth.gnss.lever_arm_m;
    GnssIns plain(config);
    untold.run(plain, drive, 40.0, 120.0);
    const Eigen::Vector3d forward = drive.errors.q_vehicle_imu.conjugate() * Eigen::Vector3d::UnitX();
    config.vehicle.mounting = log_q(Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), forward)).tail<2>();
    GnssIns filter(config);
    told.run(filter, drive, 40.0, 120.0);
  }
  std::printf("askew: level error squared over variance %.2f told, %.2f not\n", told.squares / told.variances,
              untold.squares / untold.variances);
  CHECK(told.share() >= 0.98);
  CHECK(told.squares < 1.3 * told.variances);
  CHECK(untold.squares > 4.0 * untold.variances);  // teeth
}
