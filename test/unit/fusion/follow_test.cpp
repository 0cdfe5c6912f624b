/// What the fusion takes from the INS: all of it, alone; and what its errors are known to be like.
#include "fusion/fusion.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "fusion/outlook.h"
#include "geometry/euler.h"
#include "tunnel.h"

namespace roadfix {

using namespace fusion;

namespace {

using test::planar_error;
using test::run;
using test::seconds;
using test::StreamEvent;
using test::Tunnel;

TEST_CASE("alone, the INS is what the fusion gives") {
  // Through fixes, an outage and the return from it: the filter's place and its covariance are the INS's, to the last
  // digits; with vision they are not. What is published may return more slowly.
  const Tunnel t;
  const auto off = [&](const std::vector<StreamEvent>& events) {
    Fusion fusion({});
    double largest = 0.0, largest_variance = 0.0;
    run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
      if (e.sample.channel != FusionChannel::kIns) return;
      const LevelView ins = level_view(e.sample.odometry);
      largest = std::max(largest, difference_of(f.estimate().x.segment<3>(kPos), ins.pose).norm());
      const Eigen::Matrix3d P = f.estimate().P.block<3, 3>(kPos, kPos);
      largest_variance = std::max(largest_variance, (P - ins.P).norm() / ins.P.norm());
    });
    CHECK(fusion.report().validity == Validity::kValid);
    return std::pair(largest, largest_variance);
  };
  const auto alone = off(ins_stream(t.drive, t.ins, 1));
  CHECK(alone.first < 1e-9);
  CHECK(alone.second < 1e-9);
  const auto seeing = off(t.events());
  CHECK(seeing.first > 0.1);
  CHECK(seeing.second > 0.1);
}

TEST_CASE("a gyro whose bias is known holds against a vision that turns away for some seconds") {
  // The INS says of its yaw what its gyro's bias adds up to. Taken for independent steps, that is worth less than the
  // vision's yaw in each step; known to last, it is worth more.
  Tunnel t;
  t.ins.yaw_walk = 2e-5;
  t.vo.drift_std = 0.0;
  constexpr double kBias = 2e-4, kAway = 1.2e-3;  // rad/s
  t.vo.fault = [](double s, Planar& motion) {
    if (s > 60.0 && s < 65.0) motion.z() += 0.1 * kAway;
    return true;
  };
  std::vector<StreamEvent> events = t.events();
  for (StreamEvent& e : events) {
    const double lost = seconds(t.drive, e.sample.odometry.t_us) - 40.0;
    if (e.sample.channel == FusionChannel::kIns && lost > 0.0 && lost < 60.0)
      e.sample.odometry.cov_pose(5, 5) += kBias * kBias * lost * lost;
  }
  const auto turned = [&](double known_bias) {
    Fusion fusion({});
    fusion.set_ins_gyro({0.0, 0.0, known_bias}, {});
    double before = 0.0, after = 0.0;
    run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
      const double s = seconds(t.drive, e.sample.odometry.t_us);
      const double error = planar_error(t.drive, f.fused()).error.z();
      if (s < 60.0) before = error;
      if (s < 66.0) after = error;
    });
    return std::abs(after - before);
  };
  CHECK(turned(kBias) < 0.9 * turned(0.0));
}

TEST_CASE("an INS that comes back with a velocity it does not know is not carried forward as one that does") {
  // In the tunnel, with vision, so that the fusion's place is its own; ahead of it 0.2 s of an INS that bridged a gap.
  const Tunnel t;
  constexpr double kNow = 60.0, kWrong = 3.0;  // s, m/s
  const auto sigmas_off = [&](double claimed) {
    Fusion fusion({});
    Outlook outlook;
    std::vector<StreamEvent> known;
    for (StreamEvent e : t.events()) {
      const double ahead = seconds(t.drive, e.sample.odometry.t_us) - kNow;
      if (ahead <= 0.0) known.push_back(e);
      if (ahead <= 0.0 || ahead > 0.2 || e.sample.channel != FusionChannel::kIns) continue;
      e.sample.odometry.velocity.x() += kWrong;
      e.sample.odometry.cov_velocity += claimed * claimed * Eigen::Matrix3d::Identity();
      outlook.see(e.sample);
    }
    run(fusion, known, [](const Fusion&, const StreamEvent&) {});
    const Odometry fused = outlook.poses(fusion).fused;
    REQUIRE(fused.t_us > fusion.t_us());
    const double speed = t.drive.truth_at(fused.t_us).velocity.x();
    const double of_speed = std::abs(fused.velocity.x() - speed) / std::sqrt(fused.cov_velocity(0, 0));
    return std::max(of_speed, std::sqrt(planar_error(t.drive, fused).nees()));
  };
  CHECK(sigmas_off(kWrong) < 3.0);
  CHECK(sigmas_off(0.0) > 4.0);  // teeth
}

}  // namespace
}  // namespace roadfix
