#include "evaluation/bounds.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace roadfix;

namespace {

PosePair pair_with(const Eigen::Vector2d& error, const Eigen::Matrix2d& cov) {
  PosePair pair;
  pair.estimate.T_frame_vehicle.p.head<2>() = error;
  pair.estimate.cov_pose.setIdentity();
  pair.estimate.cov_pose.topLeftCorner<2, 2>() = cov;
  return pair;
}

}  // namespace

TEST_CASE("bounds: three sigma along the largest axis, however it lies") {
  const double turn = 0.7;
  Eigen::Matrix2d R;
  R << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
  const Eigen::Matrix2d cov = R * Eigen::Vector2d(4.0, 0.25).asDiagonal() * R.transpose();
  CHECK(*horizontal_bound(pair_with({0, 0}, cov), 0.0) == Approx(6.0));
  CHECK(*horizontal_bound(pair_with({0, 0}, cov), 1.5) == Approx(7.5));
  CHECK_FALSE(horizontal_bound(pair_with({0, 0}, Eigen::Matrix2d::Zero()), 0.1));
  CHECK_FALSE(horizontal_bound(pair_with({0, 0}, Eigen::Matrix2d::Constant(std::nan(""))), 0.1));
}

TEST_CASE("bounds: bins are an eighth of a decade wide, and the ends take what is beyond") {
  CHECK(BoundHistogram::bin(0.0) == 0);
  CHECK(BoundHistogram::bin(std::nan("")) == 0);
  CHECK(BoundHistogram::bin(1.0001e-2) == 8);
  CHECK(BoundHistogram::bin(0.9999e-2) == 7);
  CHECK(BoundHistogram::bin(1e9) == BoundHistogram::kBins - 1);
}

TEST_CASE("bounds: honest errors are above three sigma about once in a hundred, of twice the size in a third") {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<PosePair> consistent, overconfident;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector2d error(normal(random), normal(random));
    consistent.push_back(pair_with(error, Eigen::Matrix2d::Identity()));
    overconfident.push_back(pair_with(2.0 * error, Eigen::Matrix2d::Identity()));
  }
  // Rayleigh: P(|e| > 3) = exp(-4.5) = 0.0111; of errors twice as large exp(-1.125) = 0.325.
  const BoundHistogram fair = horizontal_bounds(consistent, 0.0);
  CHECK(fair.samples() == 20000);
  CHECK(static_cast<double>(fair.exceeded()) / 20000 == Approx(0.0111).margin(0.003));
  CHECK(static_cast<double>(horizontal_bounds(overconfident, 0.0).exceeded()) / 20000 == Approx(0.325).margin(0.02));
  int64_t counted = 0;
  for (const auto& [cell, count] : fair.cells()) counted += count;
  CHECK(counted == 20000);
}
