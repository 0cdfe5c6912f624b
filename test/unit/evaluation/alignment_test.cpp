#include "evaluation/alignment.h"

#include <catch2/catch.hpp>

#include "evaluation/drift.h"
#include "evaluation/errors.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

const Similarity kKnown{1.7, {exp_q({0.3, -0.2, 1.1}), {12.0, -7.0, 3.0}}};
const Similarity kKnownYaw{1.0, {exp_q({0.0, 0.0, 2.5}), {-120.0, 70.0, 3.0}}};

/// The estimate such that `S` brings it back to the drive.
std::vector<PosePair> pairs_undone_by(const Similarity& S) {
  const Trajectory reference = test::eight_trajectory(0.0, 120.0, 0.5);
  const SE3 back = S.T.inverse();
  const Trajectory estimate = test::changed(reference, [&](Odometry& pose) {
    pose.T_frame_vehicle = back * pose.T_frame_vehicle;
    pose.T_frame_vehicle.p /= S.scale;
    pose.velocity /= S.scale;
  });
  return associate(estimate, reference, false);
}

double ate_after(std::vector<PosePair> pairs, Alignment alignment) {
  const Similarity S = align(pairs, alignment).value();
  for (PosePair& pair : pairs) pair.estimate = transformed(S, pair.estimate);
  return ate_rmse(pose_errors(pairs, {}));
}

TEST_CASE("Sim3 alignment recovers a known similarity") {
  const auto pairs = pairs_undone_by(kKnown);
  const Similarity S = align(pairs, Alignment::kSim3).value();
  CHECK(S.scale == Approx(kKnown.scale).epsilon(1e-12));
  CHECK(local(S.T, kKnown.T).norm() < 1e-9);
  CHECK(ate_after(pairs, Alignment::kSim3) < 1e-9);
}

TEST_CASE("an alignment with too few freedoms does not hide the error") {
  const auto pairs = pairs_undone_by(kKnown);
  CHECK(ate_after(pairs, Alignment::kSe3) > 10.0);
  CHECK(ate_after(pairs, Alignment::kYaw) > 10.0);
  CHECK(ate_after(pairs, Alignment::kNone) > 10.0);
}

TEST_CASE("yaw alignment recovers a known turn and leaves a tilt") {
  const Similarity S = align(pairs_undone_by(kKnownYaw), Alignment::kYaw).value();
  CHECK(local(S.T, kKnownYaw.T).norm() < 1e-9);
  CHECK(S.scale == 1.0);
  const Similarity tilted{1.0, {exp_q({0.02, 0.0, 0.0}), Eigen::Vector3d::Zero()}};
  CHECK(ate_after(pairs_undone_by(tilted), Alignment::kYaw) > 0.5);
  CHECK(ate_after(pairs_undone_by(tilted), Alignment::kSe3) < 1e-9);
}

TEST_CASE("a transformed pose keeps its errors and sigma in proportion") {
  Odometry pose = test::eight(4.0);
  pose.cov_pose.diagonal() << 1.0, 4.0, 9.0, 0.01, 0.02, 0.03;
  const Odometry out = transformed(kKnown, pose);
  const Eigen::Matrix3d expected =
      kKnown.scale * kKnown.scale * (kKnown.T.R() * pose.cov_pose.topLeftCorner<3, 3>() * kKnown.T.R().transpose());
  CHECK((out.cov_pose.topLeftCorner<3, 3>() - expected).norm() < 1e-12);
  CHECK((out.velocity - kKnown.scale * pose.velocity).norm() < 1e-12);
}

TEST_CASE("positions that do not determine an alignment give none") {
  std::vector<PosePair> pairs;
  for (int i = 0; i < 10; ++i) {
    PosePair pair;
    pair.estimate.T_frame_vehicle.p = pair.reference.T_frame_vehicle.p = {static_cast<double>(i), 0.0, 0.0};
    pairs.push_back(pair);
  }
  CHECK_FALSE(align(pairs, Alignment::kSe3));
  CHECK(align(pairs, Alignment::kYaw));
  pairs.resize(2);
  CHECK_FALSE(align(pairs, Alignment::kYaw));
}

}  // namespace
}  // namespace roadfix
