#include "evaluation/evaluate.h"

#include <catch2/catch.hpp>

#include "geometry/frames.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

using test::changed;
using test::eight_trajectory;
constexpr int64_t kSecond = 1'000'000;

Reference exact_reference(double dt_s = 0.1) {
  Reference reference{eight_trajectory(0.0, 200.0, dt_s), {}};
  reference.flags.resize(reference.trajectory.poses.size());
  return reference;
}

DriveFacts exact_facts() {
  DriveFacts facts;
  facts.reference = {ReferenceOf::kImu, true, true, false, 0.0};
  return facts;
}

EstimateInput estimate_of(Trajectory trajectory) {
  EstimateInput input;
  input.channel = "POSE_TEST";
  input.trajectory = std::move(trajectory);
  return input;
}

TEST_CASE("a perfect estimate scores zero everywhere and is there all the time") {
  const ChannelScore report =
      evaluate_channel(exact_reference(), exact_facts(), estimate_of(eight_trajectory(0.0, 200.0, 0.01)), {});
  CHECK(report.pairs == 2001);
  CHECK(report.ate_rmse < 1e-9);
  CHECK(report.availability.valid == Approx(1.0));
  CHECK(report.interval_s == Approx(0.1));
  CHECK(report.rpe_rmse->delta == 10);
  CHECK(report.alignment == Alignment::kNone);
  CHECK(report.kitti->translation_percent < 1e-9);
}

TEST_CASE("nothing before skip_s is scored") {
  DriveFacts facts = exact_facts();
  facts.first_fix_us = 5 * kSecond;
  facts.score.skip_s = 40.0;
  const Trajectory late = changed(eight_trajectory(0.0, 200.0, 0.01), [](Odometry& pose) {
    if (pose.t_us < 45 * kSecond) pose.T_frame_vehicle.p.x() += 100.0;
  });
  const ChannelScore report = evaluate_channel(exact_reference(), facts, estimate_of(late), {});
  CHECK(report.axes.norm.max < 1e-9);
  CHECK(report.scored.front().reference.t_us == 45 * kSecond);
  facts.score.skip_s = 39.0;
  CHECK(evaluate_channel(exact_reference(), facts, estimate_of(late), {}).axes.norm.max > 99.0);
}

TEST_CASE("references of a fix type that does not count are not scored") {
  Reference reference = exact_reference();
  for (std::size_t i = 500; i < 600; ++i) {
    reference.flags[i].may_score = false;
    reference.trajectory.poses[i].T_frame_vehicle.p.y() += 5.0;
  }
  DriveFacts facts = exact_facts();
  facts.reference.from_fixes = true;
  const ChannelScore report = evaluate_channel(reference, facts, estimate_of(eight_trajectory(0.0, 200.0, 0.01)), {});
  CHECK(report.pairs == 1901);
  CHECK(report.axes.norm.max < 1e-9);
}

TEST_CASE("where fixes were thinned out the withheld ones alone are scored") {
  Reference reference = exact_reference(0.25);
  for (std::size_t i = 0; i < reference.flags.size(); ++i) reference.flags[i].withheld = i % 4 != 0;
  // An estimate that repeats the fixes it was given and is 1 m off elsewhere.
  const Trajectory cheat = changed(eight_trajectory(0.0, 200.0, 0.25), [](Odometry& pose) {
    if (pose.t_us % kSecond != 0) pose.T_frame_vehicle.p.z() += 1.0;
  });
  DriveFacts facts = exact_facts();
  facts.reference.from_fixes = true;
  CHECK(evaluate_channel(reference, facts, estimate_of(cheat), {}).axes.norm.rms < 0.9);
  facts.score_withheld_only = true;
  const ChannelScore report = evaluate_channel(reference, facts, estimate_of(cheat), {});
  CHECK(report.axes.norm.rms == Approx(1.0));
  CHECK(report.pairs == 600);
}

TEST_CASE("fixes that were thinned out leave a reference of another origin whole") {
  const Reference reference = exact_reference();
  DriveFacts facts = exact_facts();
  facts.score_withheld_only = true;
  const auto estimate = estimate_of(eight_trajectory(0.0, 200.0, 0.1));
  CHECK(evaluate_channel(reference, facts, estimate, {}).pairs > 1900);
  facts.reference.from_fixes = true;
  CHECK(evaluate_channel(reference, facts, estimate, {}).pairs == 0);
}

TEST_CASE("usable is a pose that is near, not one that is only there") {
  const Reference reference = exact_reference();
  const auto coasting_away = [](double off_m) {
    return changed(eight_trajectory(0.0, 200.0, 0.1), [off_m](Odometry& pose) {
      if (pose.t_us < 100 * kSecond) return;
      pose.validity = Validity::kCoasting;
      pose.T_frame_vehicle.p.x() += off_m;
    });
  };
  const ChannelScore lost = evaluate_channel(reference, exact_facts(), estimate_of(coasting_away(2000.0)), {});
  CHECK(lost.availability.valid + lost.availability.coasting == Approx(1.0));
  REQUIRE(lost.usable);
  CHECK(*lost.usable == Approx(0.5).margin(0.01));
  CHECK(*evaluate_channel(reference, exact_facts(), estimate_of(coasting_away(2.0)), {}).usable == Approx(1.0));
  EvaluationOptions strict;
  strict.usable_within = 1.0;
  CHECK(*evaluate_channel(reference, exact_facts(), estimate_of(coasting_away(2.0)), strict).usable ==
        Approx(0.5).margin(0.01));
}

TEST_CASE("where it is asked for, the figures are also given without the slow part of the errors, and only there") {
  const Trajectory drifts = changed(eight_trajectory(0.0, 200.0, 0.1), [](Odometry& pose) {
    pose.T_frame_vehicle.p.x() += 0.02 * 1e-6 * static_cast<double>(pose.t_us);
  });
  EvaluationOptions options;
  options.slow_window = 10.0;
  const ChannelScore left = evaluate_channel(exact_reference(), exact_facts(), estimate_of(drifts), options);
  REQUIRE(left.slowless);
  CHECK(left.slowless->window_s == 10.0);
  CHECK(left.slowless->ate_rmse < 0.02);
  CHECK(left.ate_rmse > 2.0);  // the pose as it was published stays what it was
  CHECK(!evaluate_channel(exact_reference(), exact_facts(), estimate_of(drifts), {}).slowless);
}

TEST_CASE("the antenna's reference is compared with the antenna") {
  const Eigen::Vector3d lever_arm(1.2, 0.3, 1.5);
  Reference reference = exact_reference();
  reference.trajectory = changed(reference.trajectory, [&](Odometry& pose) {
    pose.T_frame_vehicle.p = pose.T_frame_vehicle * lever_arm;
    pose.T_frame_vehicle.q.setIdentity();
  });
  reference.trajectory.has_attitude = reference.trajectory.has_velocity = false;
  DriveFacts facts = exact_facts();
  facts.reference = {ReferenceOf::kAntenna, false, false, true, 0.0};
  auto estimate = estimate_of(eight_trajectory(0.0, 200.0, 0.1));
  CHECK(evaluate_channel(reference, facts, estimate, {}).axes.norm.rms == Approx(lever_arm.norm()));
  estimate.lever_arm = lever_arm;
  CHECK(evaluate_channel(reference, facts, estimate, {}).axes.norm.max < 1e-9);
}

TEST_CASE("an estimate in its own frame is aligned by yaw and one without scale by Sim3") {
  const SE3 T{exp_q({0, 0, 2.0}), {50.0, 60.0, -7.0}};
  auto estimate = estimate_of(changed(eight_trajectory(0.0, 200.0, 0.05), [&](Odometry& pose) {
    pose.T_frame_vehicle = T * pose.T_frame_vehicle;
    pose.T_frame_vehicle.p *= 0.2;
  }));
  for (Odometry& pose : estimate.trajectory.poses) pose.velocity *= 0.2;
  estimate.local_frame = true;
  CHECK(evaluate_channel(exact_reference(), exact_facts(), estimate, {}).ate_rmse > 10.0);
  estimate.scale_unknown = true;
  const ChannelScore report = evaluate_channel(exact_reference(), exact_facts(), estimate, {});
  CHECK(report.alignment == Alignment::kSim3);
  CHECK(report.similarity.scale == Approx(5.0));
  CHECK(report.ate_rmse < 1e-8);
  REQUIRE(report.ate_by_alignment.size() == 4);
  CHECK(report.ate_by_alignment[0].rmse > 10.0);
}

TEST_CASE("a tied odometry starts from the reference and shows its own drift from there") {
  const SE3 T{exp_q({0, 0, 1.0}), {50.0, 60.0, -7.0}};
  auto estimate = estimate_of(changed(eight_trajectory(0.0, 200.0, 0.1), [&](Odometry& pose) {
    pose.T_frame_vehicle = T * pose.T_frame_vehicle;
    if (pose.t_us > 100 * kSecond) pose.T_frame_vehicle.p.z() += 0.01 * seconds_between(100 * kSecond, pose.t_us);
  }));
  DriveFacts facts = exact_facts();
  facts.outages = {{100 * kSecond, 150 * kSecond, 151 * kSecond}};
  EvaluationOptions options;
  options.alignment = Alignment::kTied;
  ChannelScore report = evaluate_channel(exact_reference(), facts, estimate, options);
  CHECK(report.outages.each.at(0).vertical_m == Approx(0.5));
  CHECK(report.outages.each.at(0).horizontal_m < 1e-9);
  options.tie_us = 150 * kSecond;
  report = evaluate_channel(exact_reference(), facts, estimate, options);
  CHECK(report.outages.each.at(0).vertical_m == Approx(0.0).margin(1e-9));
  CHECK(report.errors.front().position_frame.z() == Approx(-0.5));
}

TEST_CASE("a rig whose x axis points up is tied by its turn about the vertical") {
  // Off by a tilt within its claim. The difference of Euler yaws means nothing there.
  const Eigen::Quaterniond q_up = exp_q({0, -0.5 * kPi, 0}) * exp_q({0, 1e-3, 2e-3});
  Reference reference = exact_reference();
  reference.trajectory =
      changed(reference.trajectory, [&](Odometry& pose) { pose.T_frame_vehicle.q = pose.T_frame_vehicle.q * q_up; });
  const SE3 T{exp_q({0, 0, 1.0}), {50.0, 60.0, -7.0}};
  auto estimate = estimate_of(changed(reference.trajectory, [&](Odometry& pose) {
    pose.T_frame_vehicle.q = exp_q({2e-3, -1e-3, 0}) * pose.T_frame_vehicle.q;
    pose.T_frame_vehicle = T * pose.T_frame_vehicle;
    pose.cov_pose = 4e-6 * Matrix6d::Identity();
  }));
  estimate.local_frame = true;
  const ChannelScore report = evaluate_channel(reference, exact_facts(), estimate, {});
  REQUIRE(report.consistency.attitude);
  CHECK(report.consistency.attitude->nees_per_dof < 1.0);
  CHECK(report.axes.yaw->max < 1e-5);
}

TEST_CASE("an odometry's covariance is judged from its own start") {
  // Error and sigma of the height grow by 1 cm a second from the start; alignment would centre the error instead.
  const SE3 T{exp_q({0, 0, 1.0}), {50.0, 60.0, -7.0}};
  auto estimate = estimate_of(changed(eight_trajectory(0.0, 200.0, 0.1), [&](Odometry& pose) {
    const double grown = 1e-4 + 0.01 * seconds_between(0, pose.t_us);
    pose.T_frame_vehicle.p.z() += grown;
    pose.T_frame_vehicle = T * pose.T_frame_vehicle;
    pose.cov_pose.diagonal() << 1e-6, 1e-6, grown * grown, 1e-8, 1e-8, 1e-8;
  }));
  estimate.local_frame = true;
  const ChannelScore report = evaluate_channel(exact_reference(), exact_facts(), estimate, {});
  CHECK(report.alignment == Alignment::kYaw);
  CHECK(report.consistency.position.nees_per_dof == Approx(1.0 / 3.0).epsilon(0.02));
  CHECK(report.consistency.position.within_3sigma == Approx(1.0));
  estimate.local_frame = false;
  EvaluationOptions aligned;
  aligned.alignment = Alignment::kYaw;
  CHECK(evaluate_channel(exact_reference(), exact_facts(), estimate, aligned).consistency.position.nees_per_dof >
        100.0);
}

TEST_CASE("an odometry's covariance is judged from its own start by a reference without attitude, too") {
  // Yaw drifts by 0.002 deg a second and is claimed so; the first 50 m cost a hundredth of a degree.
  const auto consistency_of = [](double claimed, double sigma, double end_s) {
    auto estimate = estimate_of(changed(eight_trajectory(0.0, end_s, 0.1), [&](Odometry& pose) {
      const double turned = 3.5e-5 * seconds_between(0, pose.t_us);
      const Eigen::Vector3d p = pose.T_frame_vehicle.p - test::eight(0.0).T_frame_vehicle.p;
      pose.T_frame_vehicle = SE3{exp_q({0, 0, 1.0 + turned}), {50.0, 60.0, -7.0}} * pose.T_frame_vehicle;
      const Eigen::Vector3d J = Eigen::Vector3d::UnitZ().cross(exp_q({0, 0, 1.0}) * p) * (claimed * turned);
      pose.cov_pose.topLeftCorner<3, 3>() = J * J.transpose() + 1e-3 * Eigen::Matrix3d::Identity();
    }));
    estimate.local_frame = true;
    DriveFacts facts = exact_facts();
    facts.reference = {ReferenceOf::kImu, false, false, false, sigma};
    Reference reference = exact_reference();
    reference.trajectory.has_attitude = false;
    return evaluate_channel(reference, facts, estimate, {}).consistency.position;
  };
  const ConsistencyRow consistent = consistency_of(1.0, 0.0, 200.0);
  CHECK(consistent.samples > 1900);
  CHECK(consistent.nees_per_dof < 1.0);
  CHECK(consistent.within_3sigma == Approx(1.0));
  CHECK(consistency_of(0.1, 0.0, 200.0).nees_per_dof > 10.0);  // teeth
  CHECK(consistency_of(0.1, 0.5, 200.0).nees_per_dof < 1.0);   // nobody can know with such a reference
  CHECK(consistency_of(1.0, 0.0, 3.0).samples + consistency_of(1.0, 0.0, 3.0).unusable == 0);  // too short to be tied
}

TEST_CASE("a constant latency of the reference is found where it is asked for") {
  Reference reference = exact_reference(1.0);
  for (Odometry& pose : reference.trajectory.poses) pose.t_us += 430'000;
  DriveFacts facts = exact_facts();
  facts.reference.from_fixes = true;
  const auto estimate = estimate_of(eight_trajectory(0.0, 200.0, 0.01));
  EvaluationOptions options;
  CHECK(evaluate_channel(reference, facts, estimate, options).ate_rmse > 1.0);
  options.fit_delay = true;
  const ChannelScore report = evaluate_channel(reference, facts, estimate, options);
  CHECK(report.delay_s == Approx(0.43).margin(2e-4));
  CHECK(report.ate_rmse < 5e-3);
  const PathPoint& second = report.path.at(1);  // of the report's map: in the reference's time
  CHECK((second.p - test::eight(1e-6 * static_cast<double>(second.t_us) - 0.43).T_frame_vehicle.p).norm() < 1e-2);
}

TEST_CASE("availability tells valid, coasting, invalid and silent") {
  Trajectory trajectory = eight_trajectory(0.0, 100.0, 0.1);
  for (Odometry& pose : trajectory.poses) {
    if (pose.t_us >= 20 * kSecond && pose.t_us < 30 * kSecond) pose.validity = Validity::kCoasting;
    if (pose.t_us >= 30 * kSecond && pose.t_us < 35 * kSecond) pose.validity = Validity::kInvalid;
  }
  std::erase_if(trajectory.poses,
                [](const Odometry& pose) { return pose.t_us >= 60 * kSecond && pose.t_us < 70 * kSecond; });
  const Availability a = availability(trajectory, 0, 100 * kSecond);
  CHECK(a.coasting == Approx(0.10));
  CHECK(a.invalid == Approx(0.05));
  CHECK(a.silent == Approx(0.10 - 0.002).margin(1e-9));
  CHECK(a.valid + a.coasting + a.invalid + a.silent == Approx(1.0));
  REQUIRE(a.spans.size() == 6);
  CHECK(a.spans.back().end_us == 100 * kSecond);
}

TEST_CASE("without an estimate everything is silent and nothing is scored") {
  const ChannelScore report = evaluate_channel(exact_reference(), exact_facts(), estimate_of({}), {});
  CHECK(report.pairs == 0);
  CHECK(report.availability.silent == Approx(1.0));
  CHECK(report.no_figures == "it has no poses");
}

TEST_CASE("an estimate without figures says why") {
  using Catch::Matchers::Contains;
  const Reference reference = exact_reference();
  const int64_t end_us = reference.trajectory.poses.back().t_us;
  const auto why = [&](Trajectory trajectory, const DriveFacts& facts, std::optional<Alignment> alignment = {}) {
    EvaluationOptions options;
    options.alignment = alignment;
    const ChannelScore score = evaluate_channel(reference, facts, estimate_of(std::move(trajectory)), options);
    CHECK(score.no_figures.empty() == (score.pairs > 0));
    return score.no_figures;
  };
  const auto moved = [](Trajectory trajectory, int64_t by_us) {
    for (Odometry& pose : trajectory.poses) pose.t_us += by_us;
    return trajectory;
  };
  const Trajectory good = eight_trajectory(10.0, 60.0, 0.1);
  CHECK(why(good, exact_facts()).empty());
  Trajectory bad = good;
  for (Odometry& pose : bad.poses) pose.validity = Validity::kInvalid;
  CHECK(why(bad, exact_facts()) == "all its poses are invalid");
  CHECK(why(moved(good, -75 * kSecond), exact_facts()) == "it ends 15.0 s before the reference begins");
  CHECK(why(moved(good, end_us), exact_facts()) == "it begins 10.0 s after the reference ends");
  DriveFacts late = exact_facts();
  late.score.skip_s = 80.0;
  CHECK_THAT(why(good, late), Contains("its last valid pose is 20.0 s before the first that is scored"));
  DriveFacts withheld = exact_facts();
  withheld.score_withheld_only = true;
  CHECK(why(good, withheld).empty());  // the truth is of another origin than the fixes
  withheld.reference.from_fixes = true;
  CHECK_THAT(why(good, withheld), Contains("no fix that was withheld"));
  Trajectory standing = good;
  for (Odometry& pose : standing.poses) pose.T_frame_vehicle.p.setZero();
  CHECK_THAT(why(standing, exact_facts(), Alignment::kYaw), Contains("moves too little"));
  Trajectory two = good;
  two.poses.resize(2);
  CHECK_THAT(why(two, exact_facts(), Alignment::kSe3), Contains("fewer than three"));
  DriveFacts blind = exact_facts();
  blind.reference.attitude = false;
  CHECK_THAT(why(good, blind, Alignment::kTied), Contains("attitude"));
}

}  // namespace
}  // namespace roadfix
