/// The adaptive covariance of Lee et al. (2025).
#include <catch2/catch.hpp>

#include "papers/adaptive_covariance.h"

namespace roadfix {
namespace {

TEST_CASE("Lee et al.'s ramp goes there and back without a step") {
  AdaptiveConfig c;
  c.ramp = 4.0;
  DropoutRamp ramp;
  CHECK(ramp_level(ramp, c, 0) == 0.0);
  set_gnss(ramp, c, 10'000'000, false);
  CHECK(ramp_level(ramp, c, 11'000'000) == Approx(0.25));
  set_gnss(ramp, c, 12'000'000, true);  // back after half of it
  CHECK(ramp_level(ramp, c, 12'000'000) == Approx(0.5));
  CHECK(ramp_level(ramp, c, 13'000'000) == Approx(0.25));
  CHECK(ramp_level(ramp, c, 20'000'000) == 0.0);
  const ConsistencyCheck good;
  CHECK(alpha_vio(c, good, 0.0) == c.alpha_vio);
  CHECK(alpha_vio(c, good, 1.0) == c.alpha_vio_outage);
  CHECK(alpha_gnss(c, good) == c.alpha_gnss);
  CHECK(alpha_gnss(c, ConsistencyCheck{5.0}) == 1.0);
}

TEST_CASE("Lee et al.'s clip bounds the standard deviations and keeps the correlation") {
  AdaptiveConfig c;
  Eigen::Matrix3d R = Eigen::Vector3d(1e-8, 1e6, 1e-2).asDiagonal();
  R(0, 1) = R(1, 0) = 0.5 * std::sqrt(R(0, 0) * R(1, 1));
  const Eigen::Matrix3d clipped = scaled_and_clipped(R, 1.0, c);
  CHECK(std::sqrt(clipped(0, 0)) == Approx(c.min_position));
  CHECK(std::sqrt(clipped(1, 1)) == Approx(c.max_position));
  CHECK(clipped(0, 1) / std::sqrt(clipped(0, 0) * clipped(1, 1)) == Approx(0.5));
  CHECK(scaled_and_clipped(Eigen::Matrix3d::Identity() * 0.01, 4.0, c)(0, 0) == Approx(0.04));
}

}  // namespace
}  // namespace roadfix
