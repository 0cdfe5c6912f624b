// What the monitor says of estimates: validity, covariance, jumps, contradictions, innovations.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "small_car.h"

using namespace roadfix;
using test::SmallCar;

namespace {

constexpr double kFault = 10.0, kMended = 15.0;
bool faulty(double t) { return t >= kFault && t < kMended; }

using Change = std::function<void(PoseFacts&)>;

/// The first decision at which `key` was among the reasons, with `change` made to `channel` from 10 to 15 s.
double reported(SmallCar& car, const std::string& channel, const Change& change, const std::string& key) {
  car.pose = [=](const std::string& name, double t, PoseFacts& facts) {
    if (name == channel && faulty(t)) change(facts);
  };
  car.drive(0.0, kFault);
  REQUIRE(car.health.verdict() == Verdict::kOk);
  return car.reported(key, kFault, kMended);
}

}  // namespace

TEST_CASE("an invalid judged pose is not to be used, a coasting one is degraded, and so is one in a local frame") {
  SmallCar car;
  const Change invalid = [](PoseFacts& f) {
    f.odometry.validity = Validity::kInvalid;
    f.reason = "no clock";
  };
  CHECK(reported(car, "POSE_FUSED", invalid, "pose.POSE_FUSED.invalid") <= kFault + 0.3);
  CHECK(car.health.verdict() == Verdict::kDoNotUse);
  CHECK_THAT(car.reasons(), Catch::Contains("POSE_FUSED is invalid: no clock"));
  SmallCar coasting;
  const Change coast = [](PoseFacts& f) { f.odometry.validity = Validity::kCoasting; };
  CHECK(reported(coasting, "POSE_FUSED", coast, "pose.POSE_FUSED.coasting") <= kFault + 0.3);
  CHECK(coasting.health.verdict() == Verdict::kDegraded);
  coasting.drive(kMended, kMended + 1.0);
  CHECK(coasting.health.verdict() == Verdict::kOk);
  SmallCar nowhere;
  const Change local = [](PoseFacts& f) { f.anchor.reset(); };
  CHECK(reported(nowhere, "POSE_FUSED", local, "pose.POSE_FUSED.local") <= kFault + 0.3);
  CHECK(nowhere.health.verdict() == Verdict::kDegraded);
}

TEST_CASE("an estimate that is not judged and invalid degrades, one that never worked does nothing") {
  SmallCar car;
  const Change invalid = [](PoseFacts& f) { f.odometry.validity = Validity::kInvalid; };
  CHECK(reported(car, "POSE_INS", invalid, "pose.POSE_INS.invalid") > 0.0);
  CHECK(car.health.verdict() == Verdict::kDegraded);
  SmallCar without;
  without.pose = [&](const std::string& name, double, PoseFacts& f) {
    if (name == "POSE_INS") f.odometry.validity = Validity::kInvalid;
  };
  without.drive(0.0, kFault);
  CHECK(without.health.verdict() == Verdict::kOk);
}

TEST_CASE("numbers that are none and variances below zero are not to be used") {
  SmallCar nan;
  CHECK(reported(
            nan, "POSE_FUSED", [](PoseFacts& f) { f.odometry.T_frame_vehicle.p.x() = std::nan(""); },
            "pose.POSE_FUSED.not_finite") <= kFault + 0.3);
  CHECK(nan.health.verdict() == Verdict::kDoNotUse);
  SmallCar negative;
  CHECK(reported(
            negative, "POSE_FUSED", [](PoseFacts& f) { f.odometry.cov_pose(0, 0) = -1.0; },
            "pose.POSE_FUSED.covariance") <= kFault + 0.3);
}

TEST_CASE("the covariance decides: degraded from 1.5 m on, unusable from 5 m on, by its worst direction") {
  const auto verdict = [](double major_m, double yaw_deg) {
    SmallCar car;
    car.pose = [=](const std::string&, double, PoseFacts& f) {
      // The long axis lies diagonally: neither variance alone shows it.
      const double v = 0.5 * major_m * major_m;
      f.odometry.cov_pose.topLeftCorner<2, 2>() << v, v * 0.999, v * 0.999, v;
      f.odometry.cov_pose(5, 5) = std::pow(yaw_deg * 3.14159265358979 / 180.0, 2);
    };
    car.drive(0.0, kFault);
    return car.health.verdict();
  };
  CHECK(verdict(1.4, 1.0) == Verdict::kOk);
  CHECK(verdict(1.6, 1.0) == Verdict::kDegraded);
  CHECK(verdict(5.2, 1.0) == Verdict::kDoNotUse);
  CHECK(verdict(0.1, 4.0) == Verdict::kDegraded);
  CHECK(verdict(0.1, 11.0) == Verdict::kDoNotUse);
}

TEST_CASE("the ellipse has the axes of the covariance") {
  Eigen::Matrix2d P;
  const double c = std::cos(0.3), s = std::sin(0.3);
  Eigen::Matrix2d R;
  R << c, -s, s, c;
  P = R * Eigen::Vector2d(9.0, 0.25).asDiagonal() * R.transpose();
  const HorizontalEllipse e = horizontal_ellipse(P);
  CHECK(e.major == Approx(3.0));
  CHECK(e.minor == Approx(0.5));
  CHECK(std::abs(std::tan(e.direction)) == Approx(std::tan(0.3)));
}

TEST_CASE("a jump that nobody announced is not to be used, an announced one is told and degraded") {
  for (const bool announced : {false, true}) {
    SmallCar car;
    car.pose = [=](const std::string& name, double t, PoseFacts& f) {
      if (t < kFault) return;
      if (name == "POSE_FUSED" || name == "POSE_INS") f.odometry.T_frame_vehicle.p.y() += 3.0;
      if (announced) f.reset_counter = 1;
    };
    car.drive(0.0, kFault);
    REQUIRE(car.health.verdict() == Verdict::kOk);
    const std::string key = announced ? "pose.POSE_FUSED.reset" : "pose.POSE_FUSED.jump";
    CHECK(car.reported(key, kFault, kFault + 0.8) > 0.0);
    CHECK(car.health.verdict() == (announced ? Verdict::kDegraded : Verdict::kDoNotUse));
    car.drive(kFault + 0.8, kFault + 3.0);
    CHECK(car.health.verdict() == Verdict::kOk);
  }
}

TEST_CASE("two absolute poses that are apart contradict each other, unless they say how unsure they are") {
  SmallCar car;
  CHECK(reported(
            car, "POSE_INS", [](PoseFacts& f) { f.odometry.T_frame_vehicle.p.y() += 4.0; },
            "agreement.POSE_FUSED.POSE_INS.place") <= kFault + 1.0);
  SmallCar unsure;
  const Change wide = [](PoseFacts& f) {
    f.odometry.T_frame_vehicle.p.y() += 4.0;
    f.odometry.cov_pose *= 1e4;
  };
  CHECK(reported(unsure, "POSE_INS", wide, "agreement.POSE_FUSED.POSE_INS.place") < 0.0);
}

TEST_CASE("a frame of its own hides the place, not the motion") {
  const auto contradicts = [](double scale) {
    SmallCar car;
    car.pose = [=](const std::string& name, double t, PoseFacts& f) {
      if (name != "POSE_INS") return;
      f.anchor.reset();
      const double yaw = 2.0;
      f.odometry.T_frame_vehicle.q = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
      const double way = test::kSpeed * (t < kFault ? t : kFault + scale * (t - kFault));
      f.odometry.T_frame_vehicle.p = {500.0 + way * std::cos(yaw), way * std::sin(yaw), 0.0};
      if (t >= kFault) f.odometry.velocity *= scale;
    };
    car.drive(0.0, kFault);
    return car.reported("agreement.POSE_FUSED.POSE_INS.motion", kFault, kMended);
  };
  CHECK(contradicts(1.0) < 0.0);
  CHECK(contradicts(1.05) < 0.0);
  CHECK(contradicts(1.5) > 0.0);
}

TEST_CASE("another anchor is not another place") {
  SmallCar car;
  const Geodetic other{0.8001, 0.2001, 90.0};
  const Geodetic first{0.8, 0.2, 100.0};
  car.pose = [&](const std::string& name, double t, PoseFacts& f) {
    if (name != "POSE_FUSED" || t < kFault) return;
    const EnuAnchor from(first), to(other);
    f.anchor = other;
    f.odometry.T_frame_vehicle.p = to.enu(from.geodetic(f.odometry.T_frame_vehicle.p));
    f.odometry.T_frame_vehicle.q =
        Eigen::Quaterniond(to.R_ecef_enu().transpose() * from.R_ecef_enu()) * f.odometry.T_frame_vehicle.q;
  };
  car.drive(0.0, kMended);
  INFO(car.reasons());
  CHECK(car.health.verdict() == Verdict::kOk);
}

TEST_CASE("innovations: honest ones pass, ten times too large ones and refused ones are told") {
  const auto reasons = [](double factor, bool refused) {
    SmallCar car;
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    car.tick = [&](double t) {
      if (std::lround(t * 100) % 25 != 0) return;
      double nis = 0.0;
      for (int i = 0; i < 3; ++i) nis += std::pow(normal(random), 2);
      car.health.measurement("GNSS position in INS", test::at(t), factor * nis, 3, !refused);
    };
    car.drive(0.0, 20.0);
    return car.reasons();
  };
  CHECK(reasons(1.0, false).empty());
  CHECK_THAT(reasons(10.0, false), Catch::Contains("GNSS position in INS fits worse than it claims"));
  CHECK_THAT(reasons(30.0, true), Catch::Contains("GNSS position in INS is refused"));
  CHECK(reasons(0.1, true).empty());  // not used yet, but not contradicting
}

TEST_CASE("the mean of honest innovations is one, and the window forgets") {
  NisMonitor monitor("x", ConsistencyLimits{});
  for (int i = 0; i < 100; ++i) monitor.add(test::at(0.01 * i), 2.0, 2, true);
  CHECK(monitor.report(test::at(1.0)).ratio == Approx(1.0));
  CHECK(monitor.report(test::at(1.0)).used == 100);
  for (int i = 0; i < 100; ++i) monitor.add(test::at(5.0 + 0.01 * i), 8.0, 2, true);
  CHECK(monitor.report(test::at(6.0)).ratio == Approx(4.0));
  CHECK(monitor.report(test::at(30.0)).used == 0);
}

TEST_CASE("what is refused has no say in the mean of the innovations") {
  NisMonitor monitor("x", ConsistencyLimits{});
  for (int i = 0; i < 40; ++i) monitor.add(test::at(0.01 * i), i % 4 == 0 ? 100.0 : 3.0, 2, i % 4 != 0);
  const NisReport report = monitor.report(test::at(0.4));
  CHECK(report.used == 30);
  CHECK(report.refused == 10);
  CHECK(report.ratio == Approx(1.5));
}

TEST_CASE("refusals are over once a source is used again, or has fallen silent, those that go on are not") {
  // 10 Hz, refused for 3 s; then accepted, silent, or refused every second time.
  const auto refused_until = [](const std::function<std::optional<bool>(int)>& later) {
    NisMonitor monitor("POSE_VO in FUSION", ConsistencyLimits{});
    for (int i = 0; i < 30; ++i) monitor.add(test::at(0.1 * i), 30.0, 3, false);
    double last = 0.0;
    for (int i = 30; i < 60; ++i) {
      if (const std::optional<bool> accepted = later(i))
        monitor.add(test::at(0.1 * i), *accepted ? 1.0 : 30.0, 3, *accepted);
      std::vector<Condition> conditions;
      monitor.check(test::at(0.1 * i + 0.01), conditions);
      if (!conditions.empty()) last = 0.1 * i;
    }
    return last;
  };
  CHECK(refused_until([](int) { return true; }) < 3.5);
  CHECK(refused_until([](int) { return std::nullopt; }) < 3.5);
  CHECK(refused_until([](int i) { return i % 3 == 0; }) > 5.7);
}

TEST_CASE("refusals before a source's reset are not held against it, without a reset, or behind another's, they are") {
  const auto reported_until = [](const std::string& resets) {
    SmallCar car;
    car.tick = [&](double t) {
      const int i = static_cast<int>(std::lround(t * 100.0));
      if (i % 10 != 0) return;
      const bool refused = faulty(t) || (t >= kMended && i % 30 == 0);  // now and then afterwards too
      car.health.measurement("POSE_INS in FUSION", test::at(t), refused ? 30.0 : 1.0, 3, !refused);
    };
    car.pose = [&](const std::string& name, double t, PoseFacts& facts) {
      facts.reset_counter = name == resets && t >= kMended ? 1 : 0;
    };
    double last = 0.0;
    car.drive(0.0, kMended + 5.0, [&](double t) {
      if (car.reasons().find("refused.POSE_INS in FUSION") != std::string::npos) last = t;
    });
    return last;
  };
  CHECK(reported_until("POSE_INS") < kMended + 0.45);
  CHECK(reported_until("") > kMended + 0.8);
  CHECK(reported_until("POSE_FUSED") > kMended + 0.8);
}

TEST_CASE("a source that fits again without being used is no longer told, one that errs now and then is") {
  // 10 Hz, on probation: nothing is used, and every fifth contradicts the estimate, until `fits_from_s`.
  const auto reported_until = [](double fits_from_s) {
    NisMonitor monitor("POSE_VO in FUSION", ConsistencyLimits{});
    double last = 0.0;
    for (int i = 0; i < 60; ++i) {
      const double t = 0.1 * i;
      monitor.add(test::at(t), i % 5 == 0 && t < fits_from_s ? 30.0 : 1.0, 3, false);
      std::vector<Condition> conditions;
      monitor.check(test::at(t + 0.01), conditions);
      if (!conditions.empty()) last = t;
    }
    return last;
  };
  CHECK(reported_until(3.0) < 3.05);  // the last that did not fit came at 2.5 s
  CHECK(reported_until(3.0) > 2.5);
  CHECK(reported_until(9.0) > 5.8);
}
