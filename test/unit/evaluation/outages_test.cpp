#include "evaluation/outages.h"

#include <catch2/catch.hpp>

#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

constexpr int64_t kSecond = 1'000'000;
const std::vector<Outage> kOutages = {{60 * kSecond, 90 * kSecond, 91 * kSecond},
                                      {160 * kSecond, 190 * kSecond, 191 * kSecond}};

/// An estimate that drifts sideways by rate m/s in each outage and is back in place `lag_s` after the return.
Trajectory drifting(double rate, double lag_s) {
  return test::changed(test::eight_trajectory(0.0, 250.0, 0.1), [&](Odometry& pose) {
    for (const Outage& outage : kOutages) {
      const double in_s = seconds_between(outage.first_withheld_us, pose.t_us);
      const double out_s = seconds_between(outage.return_us, pose.t_us);
      if (in_s > 0.0 && out_s < lag_s) pose.T_frame_vehicle.p.y() += rate * in_s;
    }
  });
}

const Trajectory kReference = test::eight_trajectory(0.0, 250.0, 0.1);

std::vector<PoseError> errors_of(const Trajectory& estimate) {
  return pose_errors(associate(estimate, kReference, false), {});
}

double path_length(double begin_s, double end_s) {
  double length = 0.0;
  for (double t_s = begin_s; t_s < end_s; t_s += 0.01)
    length += 0.01 * test::eight(t_s + 0.005).velocity.head<2>().norm();
  return length;
}

TEST_CASE("the error of an outage is the one at its last withheld fix") {
  const OutageErrors errors =
      outage_errors(drifting(0.1, 0.0), kReference, kOutages, errors_of(drifting(0.1, 0.0)), {});
  REQUIRE(errors.each.size() == 2);
  CHECK(errors.horizontal.rms == Approx(3.0));
  CHECK(errors.horizontal.max == Approx(3.0));
  CHECK(errors.each[0].vertical_m == Approx(0.0).margin(1e-12));
  CHECK(errors.each[0].duration_s == Approx(30.0));
  CHECK(errors.each[0].yaw_rad.value() == Approx(0.0).margin(1e-12));
  CHECK(errors.mean_distance_m == Approx(0.5 * (errors.each[0].distance_m + errors.each[1].distance_m)));
  CHECK(errors.each[0].distance_m == Approx(path_length(60.0, 90.0)).epsilon(1e-3));
  CHECK(errors.rms_percent > 0.8 * 100.0 * 3.0 / errors.mean_distance_m);
  CHECK(errors.missing == 0);
}

TEST_CASE("outages of a recorded drive are the gaps between accepted fixes") {
  std::vector<int64_t> fixes;
  for (int64_t t = 0; t <= 250; ++t)
    if (t < 60 || t > 90) fixes.push_back(t * kSecond);
  const std::vector<Outage> found = outages_between(fixes);
  REQUIRE(found.size() == 1);
  CHECK(found[0].first_withheld_us == 59 * kSecond + 1);
  CHECK(found[0].return_us == 91 * kSecond);
  CHECK(outages_between(fixes, 32.0).empty());  // teeth: 32 s are not more
  CHECK(outages_between(fixes, 0.5).size() == fixes.size() - 1);
  CHECK(outages_between({}).empty());
  const OutageErrors errors = outage_errors(drifting(0.1, 0.0), kReference, found, errors_of(drifting(0.1, 0.0)), {});
  REQUIRE(errors.each.size() == 1);
  CHECK(errors.each[0].horizontal_m == Approx(3.0).epsilon(0.05));
}

TEST_CASE("an outage without an estimate at its end is missing and not zero") {
  Trajectory estimate = drifting(0.1, 0.0);
  std::erase_if(estimate.poses, [](const Odometry& pose) { return pose.t_us > 185 * kSecond; });
  const OutageErrors errors = outage_errors(estimate, kReference, kOutages, errors_of(estimate), {});
  CHECK(errors.each.size() == 1);
  CHECK(errors.missing == 1);
}

TEST_CASE("the peak around a transition and the time to settle belong to their outage") {
  const Trajectory estimate = drifting(0.1, 4.0);  // 0.1 m/s for 31 s and on for 4 s after the return, then in place
  const OutageErrors errors = outage_errors(estimate, kReference, kOutages, errors_of(estimate), {});
  for (const OutageError& o : errors.each) {
    CHECK(o.transition_peak_m.value() == Approx(0.1 * 34.9).epsilon(1e-6));
    CHECK(o.settle_s.value() == Approx(4.0));
  }
  const Trajectory stuck = drifting(0.1, 1000.0);
  CHECK_FALSE(outage_errors(stuck, kReference, kOutages, errors_of(stuck), {}).each[1].settle_s);
}

TEST_CASE("TSE is the mean of the largest error around each loss and each return") {
  // Around each loss 0.1 * 5 s; around each return 0.1 * 31 s (the last pose before it at 30.9 s).
  const double expected = 0.5 * (0.5 + 3.09);
  CHECK(transition_stability(errors_of(drifting(0.1, 0.0)), kOutages).value() == Approx(expected).epsilon(1e-6));
  CHECK_FALSE(transition_stability(errors_of(drifting(0.1, 0.0)), {}));
}

TEST_CASE("RCT is the time from return to below 1.1 times the mean ATE") {
  CHECK(reconvergence(errors_of(drifting(0.1, 0.0)), kOutages).value().mean_s == Approx(0.0).margin(1e-9));
  const Reconvergence slow = reconvergence(errors_of(drifting(0.1, 2.0)), kOutages).value();
  CHECK(slow.mean_s == Approx(2.0).margin(0.11));
  CHECK(slow.returns == 2);
  CHECK(slow.never == 0);
}

TEST_CASE("a return that never converges is counted apart") {
  const std::vector<Outage> last = {kOutages.back()};
  const Reconvergence stuck = reconvergence(errors_of(drifting(0.1, 1000.0)), last).value();
  CHECK(stuck.returns == 1);
  CHECK(stuck.never == 1);
}

}  // namespace
}  // namespace roadfix
