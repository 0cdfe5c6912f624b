/// What the fused pose is worth while the IMU is unplugged, and when it comes back.
#include <catch2/catch.hpp>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"
#include "tunnel.h"

namespace roadfix {
namespace {

using test::planar_error;
using test::run;
using test::seconds;
using test::StreamEvent;
using test::Tunnel;

constexpr double kFrom = 20.0, kTo = 21.5;  ///< s without GNSS/INS
constexpr double kLost = 0.3;               ///< s after it, in which the INS does not know its speed; then a fix helps

/// An open road; on its return the INS is wrong in speed and place by what a second of free fall into the unknown does
/// to it, and claims `claimed` (m/s and m) beside what it always claims.
std::vector<StreamEvent> unplugged(const Tunnel& t, double wrong, double claimed) {
  std::vector<StreamEvent> events = t.events();
  std::erase_if(events, [&](const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    return e.sample.channel == FusionChannel::kIns && s > kFrom && s <= kTo;
  });
  for (StreamEvent& e : events) {
    Odometry& o = e.sample.odometry;
    const double s = seconds(t.drive, o.t_us);
    if (e.sample.channel != FusionChannel::kIns || s <= kTo || s > kTo + kLost) continue;
    o.velocity.x() -= wrong;
    o.T_frame_vehicle.p.head<2>() -= wrong * (o.T_frame_vehicle.R().leftCols<1>().head<2>());
    o.cov_velocity += claimed * claimed * Eigen::Matrix3d::Identity();
    o.cov_pose.topLeftCorner<3, 3>() += claimed * claimed * Eigen::Matrix3d::Identity();
  }
  return events;
}

TEST_CASE("an IMU that was unplugged: its speed, which it does not know, is not taken for one that lasts") {
  Tunnel t;
  t.ins.outages.clear();
  struct Worst {
    double metres = 0.0, sigmas = 0.0;
  };
  const auto worst = [&](double wrong, double claimed) {
    Fusion fusion({});
    Worst w;
    run(fusion, unplugged(t, wrong, claimed), [&](const Fusion& f, const StreamEvent& e) {
      const double s = seconds(t.drive, e.sample.odometry.t_us);
      if (s < kFrom || s > kTo + kLost) return;
      const test::PlanarError p = planar_error(t.drive, f.fused());
      const Eigen::Vector2d error = p.error.head<2>();
      w.metres = std::max(w.metres, error.norm());
      if (error.norm() < 0.1) return;  // nobody's loss
      w.sigmas = std::max(w.sigmas, std::sqrt(error.dot(p.cov.topLeftCorner<2, 2>().ldlt().solve(error))));
    });
    return w;
  };
  const Worst told = worst(1.5, 1.7), untold = worst(1.5, 0.0);
  INFO("told " << told.metres << " m, " << told.sigmas << " sigma; untold " << untold.metres << ", " << untold.sigmas);
  CHECK(told.sigmas < 3.0);
  CHECK(told.metres < 0.25);   // the INS is 1.5 m off: vision and wheels know better
  CHECK(untold.sigmas > 4.0);  // teeth
}

/// The fused poses of a drive whose wheels guess the turn and say so (times `claimed`); their yaw rates are those of
/// the guess, more `rate_off` from the second sample after the INS fell silent on.
struct Guessing {
  double nees = 0.0;  ///< of the yaw after the IMU's silence, one degree of freedom
  Planar pose = Planar::Zero();
};
Guessing guessing(const SimulatedDrive& drive, std::uint64_t seed, double claimed, double rate_off) {
  test::VoNoise guess;
  guess.rate_hz = 20.0;
  guess.yaw_step = 5e-3;  // rad: 1.6 deg in 1.5 s
  std::vector<StreamEvent> wheels = wheel_stream(drive, guess, seed);
  const Odometry* before = nullptr;
  for (StreamEvent& e : wheels) {
    Odometry& o = e.sample.odometry;
    if (before != nullptr) {
      const double turn = wrap_angle(yaw_of(o.T_frame_vehicle.q) - yaw_of(before->T_frame_vehicle.q));
      o.angular_rate.z() = turn / seconds_between(before->t_us, o.t_us);
    }
    before = &o;
    if (seconds(drive, o.t_us) > kFrom + 0.45) o.angular_rate.z() += rate_off;
    o.cov_pose.row(5) *= claimed;
    o.cov_pose.col(5) *= claimed;
  }
  std::vector<StreamEvent> events = test::merged({test::ins_stream(drive, {}, seed), wheels});
  std::erase_if(events, [&](const StreamEvent& e) {
    const double s = seconds(drive, e.sample.odometry.t_us);
    return s > kTo || (e.sample.channel == FusionChannel::kIns && s > kFrom);
  });
  Fusion fusion({});
  run(fusion, events, [](const Fusion&, const StreamEvent&) {});
  const test::PlanarError p = planar_error(drive, fusion.fused());
  return {p.error.z() * p.error.z() / p.cov(2, 2), planar_pose(fusion.fused())};
}

TEST_CASE("a yaw rate from the motion that was used already tells nothing more") {
  const SimulatedDrive drive = test::city(24.0);
  CHECK(guessing(drive, 1, 1.0, 0.0).pose == guessing(drive, 1, 1.0, 0.1).pose);
  constexpr int kSeeds = 12;
  const auto mean = [&](double claimed) {
    double sum = 0.0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) sum += guessing(drive, seed, claimed, 0.0).nees;
    return sum / kSeeds;
  };
  // Twelve of chi square are below 2.74 in 99.9 % of cases; a car that begins to turn is more than the models expect.
  const double honest = mean(1.0), boasting = mean(0.1);
  INFO(honest << ", " << boasting);
  CHECK(honest < 4.0);
  CHECK(boasting > 8.0);  // teeth
}

/// Largest error of the height, and of the local pose's rise, on a road that climbs while the IMU is unplugged for five
/// seconds; vision sees the climb, or does not.
struct Heights {
  double fused = 0.0, local = 0.0;  ///< m
};
Heights climbing(bool seen) {
  constexpr double kClimb = 0.5, kBack = 25.0;  // m/s; s
  Tunnel t;
  t.ins.outages.clear();
  t.with_wheels = false;
  t.vo.scale_std = 0.0;
  const auto truth = [&](int64_t t_us) {
    return t.drive.truth_at(t_us).T_frame_vehicle.p.z() + kClimb * seconds(t.drive, t_us);
  };
  std::vector<StreamEvent> events = t.events();
  for (StreamEvent& e : events) {
    Odometry& o = e.sample.odometry;
    if (e.sample.channel == FusionChannel::kVo && !seen) continue;
    o.T_frame_vehicle.p.z() += kClimb * seconds(t.drive, o.t_us);
    o.velocity += kClimb * (o.T_frame_vehicle.q.conjugate() * Eigen::Vector3d::UnitZ());
  }
  std::erase_if(events, [&](const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    return e.sample.channel == FusionChannel::kIns && s > kFrom && s <= kBack;
  });
  Fusion fusion({});
  Heights h;
  std::optional<double> start;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    const int64_t t_us = e.sample.odometry.t_us;
    const double s = seconds(t.drive, t_us);
    if (s < kFrom - 1.0 || s > kBack + 2.0) return;
    const double local = f.local().T_frame_vehicle.p.z() - truth(t_us);
    if (!start) start = local;
    h.local = std::max(h.local, std::abs(local - *start));
    h.fused = std::max(h.fused, std::abs(f.fused().T_frame_vehicle.p.z() - truth(t_us)));
  });
  return h;
}

TEST_CASE("what the car climbs while the IMU is unplugged counts once") {
  const Heights seen = climbing(true), unseen = climbing(false);
  INFO("seen " << seen.fused << " m, local " << seen.local << "; unseen " << unseen.fused << ", " << unseen.local);
  CHECK(seen.fused < 0.5);
  CHECK(seen.local < 0.5);
  CHECK(unseen.fused > 1.5);  // teeth: 2.5 m of climb
  CHECK(unseen.local > 1.5);
}

}  // namespace
}  // namespace roadfix
