#include "statistics/consistency.h"

#include <catch2/catch.hpp>
#include <random>

namespace roadfix {
namespace {

/// Mean NEES ratio of 50 samples of 15 states whose errors are sigma_scale times what the covariance says.
ConsistencyAccumulator sample(double sigma_scale, unsigned seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  Eigen::MatrixXd L = Eigen::MatrixXd::Identity(15, 15);
  for (int i = 1; i < 15; ++i) L(i, i - 1) = 0.5;
  ConsistencyAccumulator accumulator;
  for (int run = 0; run < 50; ++run) {
    Eigen::VectorXd z(15);
    for (int i = 0; i < 15; ++i) z(i) = normal(generator);
    const Eigen::VectorXd error = sigma_scale * L * z;
    accumulator.add(normalised_square(error, L * L.transpose()).value(), 15);
  }
  return accumulator;
}

TEST_CASE("the band of 50 runs of 15 states is that of STYLE") {
  const Band band = chi_square_band(50, 15, 0.999);
  CHECK(band.low == Approx(0.84).margin(0.005));
  CHECK(band.high == Approx(1.18).margin(0.005));
}

TEST_CASE("errors as the covariance says are consistent") {
  for (const unsigned seed : {1U, 2U, 3U}) {
    CAPTURE(sample(1.0, seed).ratio());
    CHECK(sample(1.0, seed).consistent());
  }
}

TEST_CASE("errors of 1.25 or 0.8 times the stated sigma are not consistent") {
  for (const unsigned seed : {1U, 2U, 3U}) {
    CHECK_FALSE(sample(1.25, seed).consistent());
    CHECK_FALSE(sample(0.8, seed).consistent());
  }
}

TEST_CASE("normalised square of a known error") {
  const Eigen::Vector2d error(3.0, 4.0);
  const Eigen::Matrix2d covariance = Eigen::Vector2d(9.0, 4.0).asDiagonal();
  CHECK(normalised_square(error, covariance).value() == Approx(5.0));
}

TEST_CASE("a covariance that is none gives no figure") {
  const Eigen::Vector2d error(1.0, 1.0);
  CHECK_FALSE(normalised_square(error, Eigen::Matrix2d::Zero()));
  CHECK_FALSE(normalised_square(error, -Eigen::Matrix2d::Identity()));
  CHECK_FALSE(normalised_square(error, Eigen::Matrix2d::Constant(NAN)));
}

TEST_CASE("without samples nothing is consistent") { CHECK_FALSE(ConsistencyAccumulator{}.band().holds(1.0)); }

}  // namespace
}  // namespace roadfix
