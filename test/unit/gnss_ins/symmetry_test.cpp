// The covariance stays symmetric to the bit, whatever is done to it: (M.20).
#include <catch2/catch.hpp>

#include "gnss_ins/aiding.h"
#include "gnss_ins/measurement.h"
#include "random_state.h"

using namespace roadfix;

namespace {

ErrorMatrix some_covariance(test::RandomState& random) {
  ErrorMatrix L;
  for (int i = 0; i < kStates; ++i)
    for (int k = 0; k < kStates; ++k) L(i, k) = 0.1 * random.number(1.0);
  const ErrorMatrix P = L * L.transpose();
  return 0.5 * (P + P.transpose());
}

template <class Matrix>
bool symmetric(const Matrix& m) {
  return m == m.transpose();
}

/// Subtracts Y Y' of so many random columns, whole columns at a time, from all states.
template <int Rows, class Subtract>
bool stays_symmetric(unsigned seed, const Subtract& subtract) {
  test::RandomState random(seed);
  ErrorMatrix P = some_covariance(random);
  Eigen::Matrix<double, kStates, Rows> Y;
  for (int i = 0; i < Rows; ++i) Y.col(i) = 0.1 * random.error();
  subtract(P, Y);
  return symmetric(P);
}

}  // namespace

TEST_CASE("what an update takes off the covariance is symmetric to the bit") {
  int as_product = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const auto square = [](ErrorMatrix& P, const auto& Y) { subtract_square(P, Y); };
    CHECK(stays_symmetric<1>(seed, square));
    CHECK(stays_symmetric<2>(seed, square));
    CHECK(stays_symmetric<3>(seed, square));
    // Teeth: a gain times a scaled innovation is the same product, but an element and its mirror round otherwise.
    as_product += stays_symmetric<3>(seed, [](ErrorMatrix& P, const Eigen::Matrix<double, kStates, 3>& Y) {
      const Eigen::Matrix<double, kStates, 3> gain = Y / 3.0;
      for (int j = 0; j < kStates; ++j) P.col(j) -= gain.lazyProduct(3.0 * Y.row(j).transpose());
    });
  }
  CHECK(as_product < 10);
}

TEST_CASE("updates with a fix error beside the states, and its share believed anew, stay symmetric to the bit") {
  test::RandomState random(3);
  for (int k = 0; k < 10; ++k) {
    NavState x = random.state(0.3);
    ErrorMatrix P = some_covariance(random);
    FixError error;
    const Eigen::Vector3d variance(0.5, 0.6, 2.0);
    error.expect_lasting(FixType::kSingle, {0.5, 0.1}, variance, x, P);
    BodyMotion motion;
    motion.rate = random.vector(0.3);
    Measurement<3> m = gnss_position(x, motion, x.position + random.vector(2.0), Eigen::Matrix3d::Identity(), 0.01);
    m.displaced = 0;
    Innovation<3>(P, error, m).apply(x, P, error, {});
    CHECK(symmetric(P));
    CHECK(symmetric(error.cov));
    error.expect_lasting(FixType::kSingle, {0.7, 0.1}, variance, x, P);
    CHECK(symmetric(P));
    CHECK(symmetric(error.cov));
  }
}
