// External ground truth for the metrics: figures that shared/reference/vo_peers.md, section 5, gives for trajectories
// that other people published.
#include <catch2/catch.hpp>

#include "evaluation/alignment.h"
#include "evaluation/drift.h"
#include "evaluation/errors.h"
#include "support/shared_data.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

const ReferenceKind kPoses{.attitude = true, .velocity = false};

double ate_after(std::vector<PosePair> pairs, Alignment alignment) {
  const Similarity S = align(pairs, alignment).value();
  for (PosePair& pair : pairs) pair.estimate = transformed(S, pair.estimate);
  return ate_rmse(pose_errors(pairs, kPoses));
}

struct Published {
  double ate_se3, ate_sim3, t_rel, r_rel;
};

void check(const std::vector<PosePair>& pairs, const Published& published) {
  CHECK(ate_after(pairs, Alignment::kSe3) == Approx(published.ate_se3).margin(0.006).epsilon(0.0));
  CHECK(ate_after(pairs, Alignment::kSim3) == Approx(published.ate_sim3).margin(0.006).epsilon(0.0));
  const KittiDrift drift = kitti_drift(pairs).value();
  CHECK(drift.translation_percent == Approx(published.t_rel).margin(0.006).epsilon(0.0));
  CHECK(drift.rotation_deg_per_100m == Approx(published.r_rel).margin(0.006).epsilon(0.0));
}

TEST_CASE("ORB-SLAM on KITTI 00 scores as published") {
  const auto folder = test::shared_path("data/trajectories");
  if (!folder) return;
  const auto times = test::read_times(*folder / "kitti_00_times.txt");
  const Trajectory reference = test::read_kitti(*folder / "kitti_00_reference.txt", times, false);
  const Trajectory estimate = test::read_kitti(*folder / "kitti_00_orb_slam.txt", times, false);
  const auto pairs = associate(estimate, reference, false);
  CHECK(pairs.size() == 4541);
  check(pairs, {1.30, 0.94, 0.71, 0.26});
  CHECK(kitti_drift(pairs, 10).value().translation_percent < 0.705);  // another sampling is another figure
}

TEST_CASE("SO-DSO on KITTI 06 scores as published") {
  const auto folder = test::shared_path("data/trajectories");
  if (!folder) return;
  const auto times = test::read_times(*folder / "kitti_06_times.txt");
  const Trajectory reference = test::read_kitti(*folder / "kitti_06_reference.txt", times, false);
  const Trajectory estimate = test::read_kitti(*folder / "kitti_06_so_dso_keyframes.txt", times, true);
  const auto pairs = associate(estimate, reference, false);
  CHECK(pairs.size() == 910);
  check(pairs, {3.96, 3.34, 2.02, 0.42});
}

}  // namespace
}  // namespace roadfix
