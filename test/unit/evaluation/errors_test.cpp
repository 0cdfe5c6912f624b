#include "evaluation/errors.h"

#include <catch2/catch.hpp>

#include "evaluation/drift.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

using test::changed;

const Trajectory kReference = test::eight_trajectory(0.0, 250.0, 0.1);

std::vector<PosePair> against(const Trajectory& estimate) { return associate(estimate, kReference, false); }

TEST_CASE("a constant offset in vehicle axes is found per axis") {
  const Eigen::Vector3d offset(0.3, -0.4, 0.12);
  const auto errors = pose_errors(
      against(changed(kReference, [&](Odometry& pose) { pose.T_frame_vehicle.p += pose.T_frame_vehicle.q * offset; })),
      {});
  const AxisErrors axes = axis_errors(errors, {});
  CHECK(axes.longitudinal.mean == Approx(0.3));
  CHECK(axes.lateral.mean == Approx(-0.4));
  CHECK(axes.lateral.max == Approx(0.4));
  CHECK(axes.vertical.rms == Approx(0.12));
  CHECK(axes.horizontal.rms == Approx(0.5));
  CHECK(axes.norm.p95 == Approx(std::hypot(0.5, 0.12)));
  CHECK(ate_rmse(errors) == Approx(ate_mean(errors)));
}

TEST_CASE("a turned vehicle shows as roll, pitch and yaw alone") {
  const Eigen::Vector3d turn(0.5 * kDegree, 0.0, 0.0);
  const auto errors = pose_errors(
      against(
          changed(kReference, [&](Odometry& pose) { pose.T_frame_vehicle.q = pose.T_frame_vehicle.q * exp_q(turn); })),
      {});
  const AxisErrors axes = axis_errors(errors, {});
  CHECK(axes.roll->rms == Approx(0.5 * kDegree));
  CHECK(axes.yaw->rms == Approx(0.0).margin(1e-12));
  CHECK(axes.norm.max == 0.0);
}

TEST_CASE("errors of roll, pitch and yaw are differences of the angles, on a slope too") {
  const auto sloping = [](double more) {
    return changed(kReference, [&](Odometry& pose) {
      const double yaw = yaw_pitch_roll(pose.T_frame_vehicle.q).yaw;
      pose.T_frame_vehicle.q = quaternion({yaw + more, 0.05 + 2.0 * more, -0.03 + 3.0 * more});
    });
  };
  const AxisErrors axes = axis_errors(pose_errors(associate(sloping(0.002), sloping(0.0), false), {}), {});
  CHECK(axes.yaw->mean == Approx(0.002));
  CHECK(axes.pitch->mean == Approx(0.004));
  CHECK(axes.roll->mean == Approx(0.006));
}

TEST_CASE("a rig whose x axis points up has errors about level axes and the vertical") {
  // Euler angles would call a tilt of 0.1 deg a roll and yaw of any size.
  const Eigen::Quaterniond q_up = exp_q({0, -0.5 * kPi, 0});  // x up
  const Eigen::Vector3d turn = Eigen::Vector3d(0.1, -0.2, 0.3) * kDegree;
  const Trajectory on_its_side = changed(kReference, [&](Odometry& pose) {
    pose.T_frame_vehicle.q = pose.T_frame_vehicle.q * q_up * exp_q({0.02, 0.03, -0.02});
  });
  const Trajectory turned =
      changed(on_its_side, [&](Odometry& pose) { pose.T_frame_vehicle.q = exp_q(turn) * pose.T_frame_vehicle.q; });
  const AxisErrors axes = axis_errors(pose_errors(associate(turned, on_its_side, false), {}), {});
  CHECK(axes.roll->mean == Approx(turn.x()));
  CHECK(axes.pitch->mean == Approx(turn.y()));
  CHECK(axes.yaw->mean == Approx(turn.z()));
  CHECK(axes.yaw->max == Approx(turn.z()));
}

TEST_CASE("yaw errors do not wrap") {
  const auto errors =
      pose_errors(against(changed(kReference,
                                  [](Odometry& pose) {
                                    pose.T_frame_vehicle.q = exp_q({0, 0, 0.01}) * pose.T_frame_vehicle.q;
                                  })),
                  {});
  CHECK(axis_errors(errors, {}).yaw->max == Approx(0.01));
}

TEST_CASE("a scale error of one percent drifts one percent") {
  const auto pairs = against(changed(kReference, [](Odometry& pose) { pose.T_frame_vehicle.p *= 1.01; }));
  const KittiDrift drift = kitti_drift(pairs).value();
  // Chord over arc: the displacement is shorter than the path of a curve.
  CHECK(drift.translation_percent < 1.0);
  CHECK(drift.translation_percent > 0.4);
  CHECK(drift.rotation_deg_per_100m == Approx(0.0).margin(1e-5));
  CHECK(drift.per_length.front().first == 100);
}

TEST_CASE("on a straight road the drift of a scale error is exact") {
  Trajectory reference;
  for (int i = 0; i <= 1000; ++i) {
    Odometry pose;
    pose.t_us = i * 100'000;
    pose.T_frame_vehicle.p.x() = i;
    pose.validity = Validity::kValid;
    reference.poses.push_back(pose);
  }
  const auto pairs =
      associate(changed(reference, [](Odometry& pose) { pose.T_frame_vehicle.p *= 1.02; }), reference, false);
  // Segments end at the first pose beyond the length, so they are up to one step (1 m) longer.
  CHECK(kitti_drift(pairs).value().translation_percent == Approx(2.0).epsilon(0.011));
  CHECK(rpe_mean(pairs, 100).value() == Approx(2.0));
  const RelativeError relative = rpe_rmse(pairs, 10).value();
  CHECK(relative.translation_rmse == Approx(0.2));
  CHECK(relative.rotation_rmse == Approx(0.0).margin(1e-9));
  CHECK_FALSE(rpe_mean(pairs, 5000));
}

TEST_CASE("a global turn shows in Lee et al.'s RPE and not in evo's") {
  const SE3 turn{exp_q({0, 0, 0.1}), Eigen::Vector3d::Zero()};
  const auto pairs =
      against(changed(kReference, [&](Odometry& pose) { pose.T_frame_vehicle = turn * pose.T_frame_vehicle; }));
  CHECK(rpe_mean(pairs, 100).value() > 1.0);
  CHECK(rpe_rmse(pairs, 100).value().translation_rmse < 1e-9);
}

TEST_CASE("mean norm and RMSE of uneven errors are two figures") {
  std::vector<PoseError> errors(4);
  errors[3].position_frame = {4.0, 0.0, 0.0};
  CHECK(ate_mean(errors) == Approx(1.0));
  CHECK(ate_rmse(errors) == Approx(2.0));
}

TEST_CASE("without reference attitude the estimate's own axes serve and angles are left out") {
  const ReferenceKind positions{.attitude = false, .velocity = false};
  const auto errors = pose_errors(
      against(
          changed(kReference,
                  [](Odometry& pose) { pose.T_frame_vehicle.p += pose.T_frame_vehicle.q * Eigen::Vector3d(1, 0, 0); })),
      positions);
  const AxisErrors axes = axis_errors(errors, positions);
  CHECK(axes.longitudinal.mean == Approx(1.0));
  CHECK_FALSE(axes.yaw);
  CHECK_FALSE(axes.speed);
}

}  // namespace
}  // namespace roadfix
