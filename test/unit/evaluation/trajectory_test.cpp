#include "evaluation/trajectory.h"

#include <catch2/catch.hpp>

#include "support/numerical_jacobian.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

using test::eight;
using test::eight_trajectory;

double worst_interpolation(bool with_velocity) {
  Trajectory coarse = eight_trajectory(0.0, 60.0, 1.0);
  coarse.has_velocity = with_velocity;
  double worst = 0.0;
  for (double t_s = 0.5; t_s < 60.0; t_s += 1.0) {
    const auto pose = interpolate(coarse, static_cast<int64_t>(t_s * 1e6), 2'000'000);
    worst = std::max(worst, (pose.value().T_frame_vehicle.p - eight(t_s).T_frame_vehicle.p).norm());
  }
  return worst;
}

TEST_CASE("interpolation with velocity is of fourth order, without it of second") {
  // p'' is 2 m/s2 at most: h^2/8 * 2 = 0.25 m; Hermite: h^4/384 * p'''' with p'''' up to 0.01.
  CHECK(worst_interpolation(true) < 1e-4);
  CHECK(worst_interpolation(false) > 0.05);
}

TEST_CASE("interpolated attitude follows the geodesic") {
  const Trajectory coarse = eight_trajectory(0.0, 10.0, 0.1);
  const auto pose = interpolate(coarse, 1'150'000, 1'000'000);
  CHECK(log_q(pose.value().T_frame_vehicle.q.conjugate() * eight(1.15).T_frame_vehicle.q).norm() < 1e-5);
}

TEST_CASE("what is interpolated between two poses is theirs by their nearness") {
  Trajectory two = eight_trajectory(0.0, 1.0, 1.0);
  two.poses[0].velocity = {2.0, -4.0, 1.0};
  two.poses[1].velocity = {6.0, 4.0, 1.0};
  two.poses[0].angular_rate = {0.0, 0.1, 0.3};
  two.poses[1].angular_rate = {0.4, 0.1, -0.1};
  two.poses[0].cov_pose.setIdentity();
  two.poses[1].cov_pose = 5.0 * two.poses[0].cov_pose;
  two.poses[0].cov_velocity.setIdentity();
  two.poses[1].cov_velocity = 9.0 * two.poses[0].cov_velocity;
  two.poses[1].validity = Validity::kCoasting;
  const Odometry pose = interpolate(two, 250'000, 2'000'000).value();
  CHECK(pose.velocity.isApprox(Eigen::Vector3d(3.0, -2.0, 1.0)));
  CHECK(pose.angular_rate.isApprox(Eigen::Vector3d(0.1, 0.1, 0.2)));
  CHECK(pose.cov_pose.isApprox(2.0 * two.poses[0].cov_pose));
  CHECK(pose.cov_velocity.isApprox(3.0 * two.poses[0].cov_velocity));
  CHECK(pose.validity == std::min(Validity::kValid, Validity::kCoasting));
}

TEST_CASE("nothing is interpolated outside or across a gap") {
  Trajectory trajectory = eight_trajectory(0.0, 10.0, 0.1);
  trajectory.poses.erase(trajectory.poses.begin() + 40, trajectory.poses.begin() + 60);
  CHECK_FALSE(interpolate(trajectory, -1, default_max_gap_us(trajectory)));
  CHECK_FALSE(interpolate(trajectory, 10'000'001, default_max_gap_us(trajectory)));
  CHECK_FALSE(interpolate(trajectory, 5'000'000, default_max_gap_us(trajectory)));
  CHECK(interpolate(trajectory, 3'900'000, default_max_gap_us(trajectory)));
  CHECK(interpolate(trajectory, 5'000'000, 3'000'000));
}

TEST_CASE("pairs are formed at the times of the sparser stream") {
  const Trajectory dense = eight_trajectory(0.0, 20.0, 0.005);
  const Trajectory sparse = eight_trajectory(0.0425, 19.0, 0.1);
  const auto at_reference = associate(dense, sparse, false);
  REQUIRE(at_reference.size() == sparse.poses.size());
  CHECK(at_reference.front().reference.t_us == sparse.poses.front().t_us);
  CHECK((at_reference.front().estimate.T_frame_vehicle.p - at_reference.front().reference.T_frame_vehicle.p).norm() <
        1e-9);
  const auto at_estimate = associate(sparse, dense, false);
  CHECK(at_estimate.size() == sparse.poses.size());
  // Noisy references are never interpolated.
  CHECK(associate(sparse, dense, true).size() > 10 * sparse.poses.size());
}

TEST_CASE("an invalid estimate makes no pair") {
  Trajectory estimate = eight_trajectory(0.0, 10.0, 0.1);
  for (int i = 20; i < 30; ++i) estimate.poses[static_cast<std::size_t>(i)].validity = Validity::kInvalid;
  CHECK(associate(estimate, eight_trajectory(0.0, 10.0, 0.1), false).size() == estimate.poses.size() - 10);
}

TEST_CASE("a delay pairs the reference with the earlier estimate") {
  const Trajectory estimate = eight_trajectory(0.0, 20.0, 0.01);
  const Trajectory reference =
      test::changed(eight_trajectory(2.0, 18.0, 1.0), [](Odometry& pose) { pose.t_us += 300'000; });
  for (const PosePair& pair : associate(estimate, reference, true, 300'000)) {
    CHECK((pair.estimate.T_frame_vehicle.p - pair.reference.T_frame_vehicle.p).norm() < 1e-9);
  }
  CHECK((associate(estimate, reference, true).front().estimate.T_frame_vehicle.p -
         reference.poses.front().T_frame_vehicle.p)
            .norm() > 1.0);
}

TEST_CASE("covariance and velocity follow the lever arm") {
  const Odometry pose = eight(3.0);
  const Eigen::Vector3d lever_arm(1.0, -0.5, 1.5);
  const auto point = [&](const Vector6d& d) { return Eigen::Vector3d(retract(pose.T_frame_vehicle, d) * lever_arm); };
  const Eigen::Matrix<double, 3, 6> J = test::numerical_jacobian<3, 6>(point);
  Odometry uncertain = pose;
  uncertain.cov_pose.diagonal() << 0.04, 0.09, 0.16, 1e-4, 4e-4, 9e-4;
  uncertain.cov_pose(0, 5) = uncertain.cov_pose(5, 0) = 1e-3;
  const Odometry moved = at_lever_arm(uncertain, lever_arm);
  CHECK((moved.cov_pose.topLeftCorner<3, 3>() - J * uncertain.cov_pose * J.transpose()).norm() < 1e-9);
  const double dt_s = 1e-3;
  const Eigen::Vector3d difference =
      (eight(3.0 + dt_s).T_frame_vehicle * lever_arm - eight(3.0 - dt_s).T_frame_vehicle * lever_arm) / (2 * dt_s);
  CHECK((moved.T_frame_vehicle.q * moved.velocity - difference).norm() < 1e-4);
}

}  // namespace
}  // namespace roadfix
