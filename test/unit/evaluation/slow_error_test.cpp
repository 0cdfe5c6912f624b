#include "evaluation/slow_error.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace roadfix {
namespace {

/// 200 s of 10 Hz: a drift of 5 cm/s along x and a wave of 1 s along y.
std::vector<PoseError> drift_and_wave() {
  std::vector<PoseError> errors;
  for (int i = 0; i < 2000; ++i) {
    PoseError& e = errors.emplace_back();
    e.t_us = 100'000LL * i;
    e.position_frame = {0.005 * i, 0.2 * std::sin(2.0 * M_PI * 0.1 * i), 0.0};
  }
  return errors;
}

TEST_CASE("a drift is removed but for the ends, and what is fast stays") {
  const auto errors = drift_and_wave();
  const auto left = without_slow_part(errors, 20.0);
  REQUIRE(left.size() == errors.size());
  for (std::size_t i = 150; i < 1850; ++i) {
    REQUIRE(std::abs(left[i].x()) < 1e-9);
    REQUIRE(std::abs(left[i].y() - errors[i].position_frame.y()) < 0.01);
  }
  // A window that is as short as the wave takes that as well.
  const auto shorter = without_slow_part(errors, 1.0);
  CHECK(std::abs(shorter[1025].y()) < 0.1 * std::abs(errors[1025].position_frame.y()) + 0.02);
}

TEST_CASE("figures of what is left, a hole in time makes a window of its own") {
  auto errors = drift_and_wave();
  const auto figures = slowless_figures(errors, 20.0).value();
  CHECK(figures.ate_mean < 0.3);
  CHECK(figures.ate_rmse > figures.ate_mean);
  CHECK(figures.rpe_mean.value() < 0.1);
  for (std::size_t i = 1000; i < errors.size(); ++i) {
    errors[i].t_us += 1'000'000'000;
    errors[i].position_frame.z() = 7.0;
  }
  CHECK(without_slow_part(errors, 20.0)[1500].z() == Approx(0.0).margin(1e-9));
  CHECK(without_slow_part(errors, 20.0)[999].z() == 0.0);
  CHECK(!slowless_figures({}, 20.0));
  errors.resize(50);
  CHECK(!slowless_figures(errors, 20.0)->rpe_mean);
}

}  // namespace
}  // namespace roadfix
