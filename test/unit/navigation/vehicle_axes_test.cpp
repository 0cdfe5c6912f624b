// What is published is of the vehicle's axes, though the imu's sit in it as nobody knows exactly.
#include <catch2/catch.hpp>

#include "filter_run.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "random_state.h"
#include "statistics/consistency.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

/// A phone in its holder: off by some degrees about every axis, which is all that the calibration knows.
ScenarioConfig phone() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 100.0;
  s.imu.mounting_std_rad = Eigen::Vector3d(2.0, 3.0, 7.0) * kDegree;
  return s;
}

/// Against the vehicle's truth; a turn about z is the same error in level axes.
struct Score {
  ConsistencyAccumulator attitude, velocity;
  double yaw = 0.0;  ///< deg, rms

  void add(const Navigation& filter, const Odometry& o, const SimulatedDrive& drive) {
    const Odometry truth = drive.truth_at(o.t_us);
    const EnuAnchor enu(*filter.anchor());
    const Eigen::Quaterniond q =
        Eigen::Quaterniond(enu.R_ecef_enu().transpose() * drive.anchor.R_ecef_enu()) * truth.T_frame_vehicle.q;
    const Eigen::Vector3d turn = log_q(o.T_frame_vehicle.q.conjugate() * q);
    const Eigen::Vector3d v = truth.velocity + truth.angular_rate.cross(drive.config.imu.position_m) - o.velocity;
    attitude.add(turn.dot(o.cov_pose.bottomRightCorner<3, 3>().inverse() * turn), 3);
    velocity.add(v.dot(o.cov_velocity.inverse() * v), 3);
    yaw += turn.z() * turn.z() / (kDegree * kDegree);
  }
};

struct Scores {
  Score vehicle, imu;
};

Scores drive_all(int drives) {
  Scores out;
  for (int seed = 1; seed <= drives; ++seed) {
    const SimulatedDrive drive = simulate(phone(), static_cast<uint64_t>(seed));
    NavigationConfig config = filter_config(phone());
    config.facts.p_imu_antenna = drive.errors.q_vehicle_imu.conjugate() * config.facts.p_imu_antenna;
    Navigation filter(config);
    NavigationOutput last;
    run(filter, Samples(drive), [&](Navigation& f, int64_t) {
      f.clear_records();
      last = f.output();
    });
    out.vehicle.add(filter, last.odometry, drive);
    out.imu.add(filter, last.imu, drive);
  }
  out.vehicle.yaw = std::sqrt(out.vehicle.yaw / drives);
  out.imu.yaw = std::sqrt(out.imu.yaw / drives);
  return out;
}

/// Error of a pose about another, with the velocities' in their own axes.
Eigen::Matrix<double, 9, 1> between(const Odometry& is, const Odometry& should) {
  Eigen::Matrix<double, 9, 1> e;
  e.head<3>() = should.T_frame_vehicle.p - is.T_frame_vehicle.p;
  e.segment<3>(3) = log_q(is.T_frame_vehicle.q.conjugate() * should.T_frame_vehicle.q);
  e.tail<3>() = should.velocity - is.velocity;
  return e;
}

}  // namespace

TEST_CASE("heading and velocity are the vehicle's, however the imu is mounted") {
  const Scores s = drive_all(24);
  std::printf(
      "vehicle: NEES attitude %.2f velocity %.2f, yaw %.2f deg; taken for it, the imu's: %.1f, %.1f, %.2f deg\n",
      s.vehicle.attitude.ratio(), s.vehicle.velocity.ratio(), s.vehicle.yaw, s.imu.attitude.ratio(),
      s.imu.velocity.ratio(), s.imu.yaw);
  CHECK(s.vehicle.yaw < 0.1);
  CHECK(s.vehicle.attitude.ratio() < 1.5);
  CHECK(s.vehicle.attitude.ratio() > 0.6);
  CHECK(s.vehicle.velocity.ratio() < 1.5);
  CHECK(s.vehicle.velocity.ratio() > 0.6);
  // Teeth: the imu's pose and claim in the vehicle's place.
  CHECK(s.imu.yaw > 3.0);
  CHECK(s.imu.attitude.ratio() > 20.0);
  CHECK(s.imu.velocity.ratio() > 20.0);
}

TEST_CASE("the covariance in the vehicle's axes is that of small errors of the state") {
  test::RandomNavigationState random(5);
  NavigationConfig config;
  config.facts.mounting_std = {0.03, 0.02, 0.08};
  Filter filter(config, inertial::Earth(), false);
  filter.initialise(random.mean(0.2), BaseVector::Constant(0.02));
  for (int i = 0; i < 50; ++i) filter.widen(random.error(0.02));
  const inertial::ImuRing ring;
  const auto output_of = [&](const Mean& x) {
    Filter moved = filter;
    moved.state().x = x;
    OutputPredictor predictor;
    predictor.begin(moved, ring);
    return predictor.in_vehicle_axes(predictor.output(), config.facts);
  };
  const Mean x = filter.state().x;
  const Odometry at = output_of(x);
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 9, kWithoutCamera> J;
  for (int i = 0; i < kWithoutCamera; ++i) {
    BaseVector d = BaseVector::Zero();
    d(i) = kStep;
    const Odometry plus = output_of(retract(x, d, filter.state().p_ref)),
                   minus = output_of(retract(x, -d, filter.state().p_ref));
    J.col(i) = (between(at, plus) - between(at, minus)) / (2.0 * kStep);
  }
  const Eigen::MatrixXd P = filter.state().P().topLeftCorner<kWithoutCamera, kWithoutCamera>();
  Eigen::Matrix<double, 9, 9> numeric = J * P * J.transpose();
  Eigen::Matrix<double, 9, 1> roll = Eigen::Matrix<double, 9, 1>::Zero();
  roll(3) = config.facts.mounting_std.x();
  roll.tail<3>() = skew(at.velocity) * roll.segment<3>(3);
  numeric += roll * roll.transpose();
  CHECK((numeric.topLeftCorner<6, 6>() - at.cov_pose).norm() < 1e-5 * numeric.norm());
  CHECK((numeric.bottomRightCorner<3, 3>() - at.cov_velocity).norm() < 1e-5 * numeric.norm());
  // Teeth: without the mounting's part.
  J.middleCols<2>(kMounting).setZero();
  const Eigen::Matrix<double, 9, 9> without = J * P * J.transpose();
  CHECK((without.topLeftCorner<6, 6>() - at.cov_pose).norm() > 1e-3 * at.cov_pose.norm());
}
