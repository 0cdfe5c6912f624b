#include "evaluation/covariance_consistency.h"

#include <catch2/catch.hpp>
#include <random>

#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

/// Poses with independent errors of exactly the stated covariance, which is correlated between position and attitude;
/// what is published is that covariance times `claim`.
std::vector<PosePair> noisy_pairs(double claim) {
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal(0.0, 1.0);
  Matrix6d L = Matrix6d::Zero();
  L.diagonal() << 0.1, 0.2, 0.4, 0.01, 0.02, 0.03;
  L(3, 0) = 0.005;
  L(5, 1) = -0.02;
  std::vector<PosePair> pairs;
  for (int i = 0; i < 4000; ++i) {
    PosePair pair;
    pair.reference = test::eight(0.1 * i);
    pair.estimate = pair.reference;
    Vector6d z;
    for (int k = 0; k < 6; ++k) z(k) = normal(generator);
    Eigen::Vector3d v;
    for (int k = 0; k < 3; ++k) v(k) = normal(generator);
    pair.estimate.T_frame_vehicle = retract(pair.reference.T_frame_vehicle, L * z);
    pair.estimate.velocity += 0.05 * v;
    pair.estimate.cov_pose = claim * L * L.transpose();
    pair.estimate.cov_velocity = claim * 0.0025 * Eigen::Matrix3d::Identity();
    pairs.push_back(pair);
  }
  return pairs;
}

TEST_CASE("errors of the stated covariance have NEES one and 99.7 percent within three sigma") {
  const CovarianceConsistency h = covariance_consistency(noisy_pairs(1.0), {}, 0.0);
  // 4000 samples: one standard deviation of the ratio is sqrt(2 / (4000 dof)), at most 0.013.
  CHECK(h.position.nees_per_dof == Approx(1.0).margin(0.05));
  CHECK(h.attitude->nees_per_dof == Approx(1.0).margin(0.05));
  CHECK(h.pose->nees_per_dof == Approx(1.0).margin(0.05));
  CHECK(h.velocity->nees_per_dof == Approx(1.0).margin(0.05));
  CHECK(h.position.within_3sigma == Approx(0.9973).margin(0.002));
  CHECK(h.position.median_sigma == Approx(std::sqrt(0.01 + 0.04 + 0.16)).epsilon(1e-9));
}

TEST_CASE("overconfident and inflated covariances both show") {
  CHECK(covariance_consistency(noisy_pairs(0.25), {}, 0.0).pose->nees_per_dof == Approx(4.0).margin(0.2));
  CHECK(covariance_consistency(noisy_pairs(0.25), {}, 0.0).position.within_3sigma < 0.95);
  const CovarianceConsistency inflated = covariance_consistency(noisy_pairs(25.0), {}, 0.0);
  CHECK(inflated.position.nees_per_dof < 0.1);
  CHECK(inflated.position.median_sigma > 5.0 * inflated.position.median_error);
}

TEST_CASE("the reference's own sigma is added") {
  const double without = covariance_consistency(noisy_pairs(1.0), {}, 0.0).position.nees_per_dof;
  CHECK(covariance_consistency(noisy_pairs(1.0), {}, 1.0).position.nees_per_dof < 0.1 * without);
}

TEST_CASE("a covariance that is none is counted and not scored") {
  auto pairs = noisy_pairs(1.0);
  pairs[0].estimate.cov_pose.setZero();
  pairs[1].estimate.cov_pose(0, 0) = -1.0;
  const CovarianceConsistency h = covariance_consistency(pairs, {}, 0.0);
  CHECK(h.position.unusable == 2);
  CHECK(h.position.samples == 3998);
}

TEST_CASE("sigmas of the plots are in vehicle axes") {
  auto pairs = noisy_pairs(1.0);
  pairs.resize(1);
  PosePair& pair = pairs[0];
  pair.reference.T_frame_vehicle.q = pair.estimate.T_frame_vehicle.q = exp_q({0, 0, 1.5707963267948966});
  pair.estimate.cov_pose = Matrix6d::Identity();
  pair.estimate.cov_pose(0, 0) = 4.0;  // east: to the right of a car that looks north
  const SigmaSample s = sigma_samples(pairs, {}, 0.0)[0];
  CHECK(s.position_vehicle.x() == Approx(1.0));
  CHECK(s.position_vehicle.y() == Approx(2.0));
}

}  // namespace
}  // namespace roadfix
