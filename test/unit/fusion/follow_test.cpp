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

using test::InsNoise;
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

TEST_CASE("alone, the INS's height is what the fusion gives, however little the INS says that it loses") {
  const auto off = [](bool with_vision) {
    Tunnel t;
    t.ins.velocity_walk = 1e-4;
    t.with_wheels = false;
    Fusion fusion({});
    double largest = 0.0;  // share of the variance that the fusion has too much, in the outage
    run(fusion, with_vision ? t.events() : ins_stream(t.drive, t.ins, 1), [&](const Fusion& f, const StreamEvent& e) {
      if (e.sample.channel != FusionChannel::kIns || e.gnss) return;
      largest = std::max(largest, f.fused().cov_pose(2, 2) / e.sample.odometry.cov_pose(2, 2) - 1.0);
    });
    return largest;
  };
  CHECK(off(false) < 1e-9);
  CHECK(off(true) > 1e-4);  // teeth: there only what it gained is taken
}

/// Distances (m), at the INS's first pose: of the fused pose from it, and of the way that the local pose has gone from
/// the true one. Before that there were two pictures of a vision that begins at speed and does not know it at its first
/// one: `sigma` (m/s), what it says.
struct FirstPose {
  double in_enu = 0.0, local = 0.0;
};

FirstPose off_at_first_pose(double sigma) {
  constexpr double kVision = 20.0, kIns = 20.15;
  Tunnel t;
  t.with_wheels = false;
  std::vector<StreamEvent> events = t.events();
  std::erase_if(events, [&](const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    return s < (e.sample.channel == FusionChannel::kIns ? kIns : kVision);
  });
  Odometry& first = events.front().sample.odometry;
  REQUIRE(first.velocity.x() > 5.0);
  first.velocity.setZero();
  first.cov_velocity = sigma * sigma * Eigen::Matrix3d::Identity();
  const Eigen::Vector3d began = t.drive.truth_at(first.t_us).T_frame_vehicle.p;
  Fusion fusion({});
  std::optional<Eigen::Vector3d> local_began;
  std::optional<FirstPose> off;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    if (off) return;
    const Eigen::Vector3d local = f.local().T_frame_vehicle.p;
    if (!local_began) local_began = local;
    if (e.sample.channel != FusionChannel::kIns) return;
    const Odometry& o = e.sample.odometry;
    const double way = (t.drive.truth_at(o.t_us).T_frame_vehicle.p - began).norm();
    off = FirstPose{(f.fused().T_frame_vehicle.p - o.T_frame_vehicle.p).norm(),
                    std::abs((local - *local_began).norm() - way)};
  });
  return off.value();
}

TEST_CASE("the first pose in enu has nothing to make up") {
  const FirstPose off = off_at_first_pose(30.0);
  CHECK(off.in_enu < 0.01);
  CHECK(off.local > 0.02);  // teeth: the local pose, told all along, has, and makes it up at its bounded rate
}

TEST_CASE("a gyro whose bias is known holds against a vision that turns away for some seconds") {
  // The INS says of its yaw what its gyro's bias adds up to. Taken for independent steps, that is worth less than the
  // vision's yaw in each step; known to last, it is worth more. After 25 s this bias turns the INS by 1.3e-3 rad, this
  // vision is unsure of 2.4e-3: of the 6e-3 that it turns, 22 % are to be believed, as independent steps 31 %.
  Tunnel t;
  t.ins.yaw_walk = 2e-5;
  t.vo.turns_std = 0.0;
  constexpr double kBias = 5e-5, kAway = 1.2e-3;  // rad/s
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
  CHECK(turned(kBias) < 0.8 * turned(0.0));
}

/// Shares of the INS's errors that the fusion has in its yaw, and that it knows of in the velocity across the vehicle,
/// once the INS has turned off by 1.5e-3 rad in eight seconds with fixes that keep its place, and half says so.
std::pair<double, double> turned_off(bool with_vision) {
  constexpr double kBegin = 60.0, kLasts = 8.0, kOff = 1.5e-3, kClaimed = 0.5;
  Tunnel t;
  t.with_wheels = false;
  t.ins.outages.clear();
  t.ins.fix_period = 0.2;
  t.ins.fix_sigma = 0.01;
  t.ins.velocity_walk = 0.01;
  t.ins.yaw_sigma = 2e-4;
  t.ins.yaw_walk = 1e-5;
  t.vo.yaw_step = 1e-5;
  t.vo.turns_std = 0.0;
  std::vector<StreamEvent> events = t.events();
  std::erase_if(events, [&](const StreamEvent& e) { return !with_vision && e.sample.channel == FusionChannel::kVo; });
  for (StreamEvent& e : events) {
    const double s = seconds(t.drive, e.sample.odometry.t_us) - kBegin;
    e.sample.turns_exact = e.sample.channel == FusionChannel::kVo;
    if (e.sample.channel != FusionChannel::kIns || s < 0.0) continue;
    Odometry& o = e.sample.odometry;
    const double off = kOff * std::min(1.0, s / kLasts);
    const Eigen::Quaterniond turn = quaternion({off, 0.0, 0.0});
    o.T_frame_vehicle.q = turn * o.T_frame_vehicle.q;
    o.velocity = turn.conjugate() * o.velocity;
    if (s < kLasts) o.angular_rate.z() += kOff / kLasts;
    o.cov_pose(5, 5) += std::pow(kClaimed * off, 2);
    o.cov_velocity(1, 1) += std::pow(kClaimed * off * o.velocity.x(), 2);
  }
  Fusion fusion({});
  double yaw = 0.0, across = 0.0;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    if (seconds(t.drive, e.sample.odometry.t_us) > kBegin + kLasts) return;
    const Vector x = f.estimate().x;
    yaw = -test::planar_error(t.drive, f.fused()).error.z() / kOff;
    across = (std::sin(x(kYaw)) * x(kInsVelocity) - std::cos(x(kYaw)) * x(kInsVelocity + 1)) / (kOff * x(kSpeed));
  });
  return {yaw, across};
}

TEST_CASE("an INS that turns off beside its fixes takes nobody with it whom vision tells") {
  const auto seen = turned_off(true), blind = turned_off(false);
  INFO("yaw " << seen.first << ", across " << seen.second << "; without vision " << blind.first << ", "
              << blind.second);
  CHECK(seen.first < 0.35);
  CHECK(seen.second > 0.4);
  CHECK(blind.first > 0.9);  // teeth
  CHECK(std::abs(blind.second) < 0.1);
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

/// An INS alone whose pose is corrected by a metre at 60 s, as it is published 0.2 s ahead of the horizon.
struct MadeUp {
  double largest_step = 0.0;  ///< m, beyond the INS's own motion
  double after_100ms = 0.0;   ///< m made up
  double settled_s = 0.0;     ///< since the correction
};
MadeUp made_up(const ReturnConfig& config) {
  const Tunnel t;
  constexpr double kCorrected = 60.0, kOff = 1.0;  // s, m
  InsNoise ins;
  ins.fix_period = 1e3;  // no other fix
  FusionConfig c;
  c.comeback = config;
  Fusion fusion(c);
  Outlook outlook;
  const std::vector<StreamEvent> events = ins_stream(t.drive, ins, 1);
  std::size_t applied = 0;
  double last = 0.0;
  MadeUp m;
  for (std::size_t i = 0; i < events.size(); ++i) {
    const auto sample = [&](std::size_t k) {
      ChannelSample of = events[k].sample;
      if (seconds(t.drive, of.odometry.t_us) >= kCorrected) of.odometry.T_frame_vehicle.p.x() += kOff;
      return of;
    };
    const ChannelSample newest = sample(i);
    outlook.see(newest);
    for (; events[applied].sample.odometry.t_us + 200'000 <= newest.odometry.t_us; ++applied) {
      outlook.drop_until(events[applied].sample.odometry.t_us);
      (void)fusion.add(sample(applied));
    }
    const double s = seconds(t.drive, newest.odometry.t_us) - kCorrected;
    if (s < -1.0 || s > 5.0) continue;
    const Odometry fused = outlook.poses(fusion).fused;
    REQUIRE(fused.t_us == newest.odometry.t_us);
    const double off = (fused.T_frame_vehicle.p - events[i].sample.odometry.T_frame_vehicle.p).x();
    m.largest_step = std::max(m.largest_step, std::abs(off - last));
    if (s < 0.1001) m.after_100ms = off;
    if (std::abs(off - kOff) > 1e-6) m.settled_s = s;
    last = off;
  }
  return m;
}

TEST_CASE("a return begins with the fix, not when the horizon has come there, and keeps to its rate") {
  ReturnConfig config;
  const MadeUp even = made_up(config);
  const double dt = 0.02;
  CHECK(even.largest_step < 1.01 * config.rate * dt);
  CHECK(even.after_100ms > 0.8 * config.rate * (0.1 - dt));
  CHECK(even.settled_s < 1.0 / config.rate + 2.0 * dt);
  config.ignored = 2.0;
  CHECK(made_up(config).largest_step > 0.99);  // teeth: as it is
}

}  // namespace
}  // namespace roadfix
