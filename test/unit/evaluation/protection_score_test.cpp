#include "evaluation/protection_score.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace roadfix;

namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

ProtectionSample sample(int64_t t_us, double frequent, double rare, bool usable = true) {
  return {t_us,
          {1e-3, 1e-5},
          {Eigen::Vector3d::Constant(frequent), Eigen::Vector3d::Constant(rare)},
          {1.4, 0.57, 1.3},
          usable};
}

PoseError error(int64_t t_us, const Eigen::Vector3d& e) {
  PoseError pose;
  pose.t_us = t_us;
  pose.position_vehicle = e;
  return pose;
}

}  // namespace

TEST_CASE("protection score: misleading in any axis, available within the limits, hazardous beyond them") {
  const std::vector<ProtectionSample> levels = {sample(0, 0.1, 0.2), sample(100'000, 0.1, 0.2),
                                                sample(200'000, 0.1, 0.6, false),
                                                sample(300'000, 0.1, kUnbounded, false), sample(400'000, 0.1, 0.2)};
  const std::vector<PoseError> errors = {error(0, {0.05, -0.05, 0.0}), error(100'000, {0.15, 0.0, 0.0}),
                                         error(200'000, {0.0, -0.15, 0.0}), error(300'000, {9.0, 9.0, 9.0}),
                                         error(400'000, {0.0, 0.6, 0.0})};
  const auto score = protection_score(levels, errors, 0.0);
  REQUIRE(score);
  CHECK(score->samples == 4);
  CHECK(score->unbounded == 1);
  CHECK(score->usable == 3);
  CHECK(score->interruptions == 1);
  const RiskScore &frequent = score->risks[0], &rare = score->risks[1];
  CHECK(frequent.misleading == 3);
  CHECK(frequent.by_axis == std::array<int64_t, 3>{1, 2, 0});
  CHECK(rare.misleading == 1);
  CHECK(rare.available == 3);  // 0.6 is more than 0.57 across
  CHECK(rare.hazardous == 1);
  CHECK(rare.diagram[1].exceeded() == 1);
  CHECK(rare.diagram[0].samples() == 4);
  CHECK(score->longest_misled_s == Approx(0.1));
}

TEST_CASE("protection score: the series has every sample with its error, levels of other risks are left out") {
  std::vector<ProtectionSample> levels = {sample(0, 0.1, 0.2), sample(100'000, 0.1, kUnbounded),
                                          sample(200'000, 0.1, 0.2)};
  levels[2].risk = {1e-3};
  levels[2].level.pop_back();
  const std::vector<PoseError> errors = {error(0, {0.05, -0.07, 0.0}), error(100'000, {0.0, 0.0, 0.0}),
                                         error(200'000, {0.0, 0.0, 0.0})};
  const auto score = protection_score(levels, errors, 0.0);
  REQUIRE(score);
  REQUIRE(score->series.size() == 2);
  CHECK(score->series[0].error == Eigen::Vector3d(0.05, 0.07, 0.0));
  CHECK(score->series[1].levels.pose_us == 100'000);
}

TEST_CASE("protection score: the reference's own error widens a level as far as it can explain") {
  const std::vector<ProtectionSample> levels = {sample(0, 0.1, 0.2)};
  const std::vector<PoseError> errors = {error(0, {0.3, 0.0, 0.0})};
  CHECK(protection_score(levels, errors, 0.0)->risks[1].misleading == 1);
  CHECK(protection_score(levels, errors, 0.1)->risks[1].misleading == 0);
  CHECK(protection_score(levels, errors, 0.01)->risks[1].misleading == 1);
}

TEST_CASE("protection score: a level without an error at its time says nothing") {
  CHECK_FALSE(protection_score({sample(0, 0.1, 0.2)}, {error(70'000, {9.0, 0.0, 0.0})}, 0.0));
  CHECK_FALSE(protection_score({}, {error(0, {9.0, 0.0, 0.0})}, 0.0));
  CHECK_FALSE(protection_score({sample(0, 0.1, 0.2)}, {}, 0.0));
}

TEST_CASE("protection score: errors that stay alike are few independent samples") {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const auto independent = [&](double kept) {
    std::vector<ProtectionSample> levels;
    std::vector<PoseError> errors;
    double e = normal(random);
    for (int64_t i = 0; i < 5000; ++i) {
      e = kept * e + std::sqrt(1.0 - kept * kept) * normal(random);
      levels.push_back(sample(100'000 * i, 10.0, 20.0));
      errors.push_back(error(100'000 * i, {e, e, e}));
    }
    return protection_score(levels, errors, 0.0)->independent;
  };
  CHECK(independent(0.0) > 3500.0);
  CHECK(independent(0.9) < 800.0);
  CHECK(independent(0.99) < 150.0);
}

TEST_CASE("protection score: no event in n independent samples bounds the risk at 3/n") {
  CHECK(risk_bounded_at(0, 1000.0) == Approx(3e-3).epsilon(0.002));
  CHECK(risk_bounded_at(1, 1000.0) == Approx(4.74e-3).epsilon(0.001));  // Garwood: 4.744
  CHECK(risk_bounded_at(0, 0.0) == 1.0);
  CHECK(independent_events(10, 1000, 100.0) == 1);
  CHECK(independent_events(11, 1000, 100.0) == 2);
  CHECK(independent_events(0, 1000, 100.0) == 0);
}
