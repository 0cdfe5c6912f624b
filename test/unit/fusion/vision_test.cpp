/// What becomes of a good vision: what it shows of the INS lasts, and a loss or a new map of it is no harm.
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "geometry/euler.h"
#include "geometry/so3.h"
#include "tunnel.h"

namespace roadfix {

using namespace fusion;

namespace {

using test::run;
using test::seconds;
using test::StreamEvent;
using test::Tunnel;
using test::Watch;

/// What the fusion holds of the INS's velocity error at 90 s, where the INS says of its velocity's variance `said`
/// times what it is.
struct Held {
  double error = 0.0;  ///< m/s
  double sigma = 0.0;  ///< m/s
};
Held held(const std::function<double(double t_s)>& said) {
  Tunnel t;
  t.ins.velocity_walk = 0.0;  // what it errs by at the loss lasts
  std::vector<StreamEvent> events = t.events();
  for (StreamEvent& e : events) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    if (e.sample.channel != FusionChannel::kIns || s < 40.0) continue;
    e.sample.odometry.velocity.x() += 0.05;
    e.sample.odometry.cov_velocity *= said(s) * 0.0025 / e.sample.odometry.cov_velocity(0, 0);
  }
  Fusion fusion({});
  Held h;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    if (seconds(t.drive, e.sample.odometry.t_us) > 89.99) return;
    h.error = f.estimate().x.segment<2>(kInsVelocity).norm();
    h.sigma = std::sqrt(f.estimate().P(kInsVelocity, kInsVelocity));
  });
  return h;
}

TEST_CASE("wheels that steady the INS's velocity ten times a second do not make its lasting error a new one") {
  const Held even = held([](double) { return 1.0; });
  const Held wheels = held([](double t_s) { return std::fmod(10.0 * t_s, 1.0) < 0.5 ? 0.94 : 1.0; });
  CHECK(even.sigma < 0.02);  // vision has shown it
  CHECK(wheels.sigma < 1.1 * even.sigma);
  CHECK(std::abs(wheels.error - even.error) < 0.1 * even.error);
  // A car that comes to stand knows its speed: what was held is void.
  const Held stands = held([](double t_s) { return t_s < 89.97 ? 1.0 : 0.1; });
  CHECK(stands.error < 0.8 * even.error);  // the speed that the fusion holds tells some of it again
}

/// An INS that is taken `off` m to the east at 50 s and stays there, beside a good vision.
struct GivenWay {
  std::optional<double> at_s;  ///< when the fusion gave way
  double before = 0.0;         ///< m, from the INS to the fused place, a second before
  double after = 0.0;          ///< m, largest from two seconds after it on
  int refused = 0;             ///< pictures, from then on
  double within_before = 0.0;  ///< share of the published poses within 3 sigma of where the car is, by 50 to 60 s
  double within_after = 0.0;   ///< the same of the ten seconds after
  bool coasting = true;        ///< the pose never called itself valid in those
};
GivenWay given_way(double off) {
  Tunnel t;
  t.ins.outages.clear();
  t.ins.velocity_walk = 0.005;
  t.with_wheels = false;
  std::vector<StreamEvent> events = t.events();
  for (StreamEvent& e : events) {
    const bool wrong = e.sample.channel == FusionChannel::kIns && seconds(t.drive, e.sample.odometry.t_us) > 50.0;
    if (wrong) e.sample.odometry.T_frame_vehicle.p.x() += off;
  }
  Fusion fusion({});
  GivenWay g;
  double away = 0.0;
  int before = 0, after = 0;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    if (s < 50.0) return;
    if (e.sample.channel == FusionChannel::kVo) {
      if (g.at_s && f.channel(FusionChannel::kVo).status == FuseStatus::kGated) ++g.refused;
      return;
    }
    const test::PlanarError p = test::planar_error(t.drive, f.fused());
    const double within = p.distance() < 3.0 * std::sqrt(p.cov.topLeftCorner<2, 2>().trace()) ? 1.0 : 0.0;
    if (!g.at_s && f.channel(FusionChannel::kIns).status == FuseStatus::kReset) {
      g.at_s = s;
      g.before = away;
    }
    away = (f.estimate().x.head<2>() - planar_pose(e.sample.odometry).head<2>()).norm();
    if (!g.at_s) {
      g.within_before += within;
      ++before;
    } else {
      if (s > *g.at_s + 2.0) g.after = std::max(g.after, away);
      if (s > *g.at_s + 10.0) return;
      g.within_after += within;
      g.coasting = g.coasting && f.report().validity == Validity::kCoasting;
      ++after;
    }
  });
  g.within_before /= std::max(1, before);
  g.within_after /= std::max(1, after);
  return g;
}

TEST_CASE("giving way takes the vision's own pose along: it neither pulls back nor is refused") {
  const GivenWay g = given_way(15.0), none = given_way(0.0);
  CHECK(!none.at_s);
  REQUIRE(g.at_s);
  INFO("at " << *g.at_s << " s: " << g.before << " m away before, " << g.after << " after, " << g.refused
             << " refused");
  CHECK(*g.at_s > 60.0);  // ten seconds of contradiction
  CHECK(*g.at_s < 63.0);
  CHECK(g.before > 10.0);
  CHECK(g.after < 0.5);
  CHECK(g.refused == 0);
}

TEST_CASE("who gave way to an INS that vision contradicts says so, and how wrong it may be") {
  const GivenWay g = given_way(15.0);  // and here the vision was right
  REQUIRE(g.at_s);
  INFO(g.within_before << " before, " << g.within_after << " after");
  CHECK(g.within_before > 0.99);
  CHECK(g.within_after > 0.99);
  CHECK(g.coasting);
}

/// Yaw error at the end of a tunnel beside a vision of the same gyro, whose bias the INS has wrong by 0.003 rad/s and
/// says `said` of it.
double yaw_off(double said) {
  Tunnel t;
  t.with_wheels = false;
  t.vo.turns_std = 0.0;
  std::vector<StreamEvent> events = t.events();
  for (StreamEvent& e : events) {
    e.sample.shares_imu = e.sample.channel == FusionChannel::kVo;
    const double lost = seconds(t.drive, e.sample.odometry.t_us) - 40.0;
    if (e.sample.channel != FusionChannel::kIns || lost < 0.0) continue;
    Odometry& o = e.sample.odometry;
    const YawPitchRoll a = yaw_pitch_roll(o.T_frame_vehicle.q);
    o.T_frame_vehicle.q = quaternion({a.yaw + 0.003 * lost, a.pitch, a.roll});
    o.angular_rate.z() += 0.003;
    const double variance = said * said * lost * lost;
    o.cov_pose(5, 5) += variance;
  }
  Fusion fusion({});
  double off = 0.0;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    fusion.set_ins_gyro(Eigen::Vector3d::Constant(said), {});
    if (seconds(t.drive, e.sample.odometry.t_us) > 99.0) return;
    off = wrap_angle(f.estimate().x(kYaw) - planar_pose(t.drive.truth_at(e.sample.odometry.t_us)).z());
  });
  return std::abs(off);
}

TEST_CASE("of two that share a gyro the one that knows its bias speaks of the yaw") {
  const double known = yaw_off(0.01), hidden = yaw_off(1e-6);
  INFO(known << " rad, " << hidden << " where the INS says nothing of its bias");
  CHECK(known < 0.05);
  CHECK(hidden > 0.1);  // teeth
}

/// In the tunnel a vision drives off from 50 s, tells nothing from 52 s to 53 s, and goes on from there in a new map
/// (`reset`) whose lengths are wrong by `scaled`; again nothing from 58 s to 59 s.
struct NewMap {
  int used = 0, refused = 0;     ///< pictures, in the five seconds of the map
  double first_used_s = 99.0;    ///< since the map began
  double largest = 0.0;          ///< m, of the fused pose in them
  std::vector<double> asked_at;  ///< s: restarts
  double restart_off = 0.0;      ///< m, the last of them, in the frame of the new map
};
NewMap new_map(bool reset, double scaled) {
  Tunnel t;
  t.ins.velocity_walk = 0.005;  // an INS with wheels
  t.with_wheels = false;
  t.vo.fault = [&](double s, Planar& motion) {
    if (s > 50.0 && s < 52.05) motion.y() += 0.3;
    if (s > 53.05) motion.head<2>() *= scaled;
    return true;
  };
  std::vector<StreamEvent> events = t.events();
  for (StreamEvent& e : events) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    if (e.sample.channel != FusionChannel::kVo || s < 52.05) continue;
    if (s < 52.95 || (s > 57.95 && s < 58.95)) e.sample.odometry.validity = Validity::kInvalid;
    if (reset) e.sample.reset_counter = s < 58.95 ? 1 : 2;
  }
  Fusion fusion({});
  Watch watch{t.drive, 52.95, 57.95};
  NewMap m;
  std::optional<SE3> T_vo_vehicle;  // newest of the map
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    watch(f, e);
    if (fusion.asks_restart()) {
      const VisionRestart restart = fusion.take_restart(fusion.fused());
      m.asked_at.push_back(s);
      if (T_vo_vehicle) m.restart_off = (restart.T_vo_vehicle.p - T_vo_vehicle->p).head<2>().norm();
    }
    if (e.sample.channel != FusionChannel::kVo || s < 52.95 || s > 57.95) return;
    T_vo_vehicle = e.sample.odometry.T_frame_vehicle;
    const FuseStatus status = f.channel(FusionChannel::kVo).status;
    if (status == FuseStatus::kGated) ++m.refused;
    if (status != FuseStatus::kAccepted) return;
    if (m.used++ == 0) m.first_used_s = s - 53.0;
  });
  m.largest = watch.largest;
  return m;
}

TEST_CASE("a new map is another witness: it is heard from its second pose on, and refused if it does not fit") {
  const NewMap fits = new_map(true, 1.0), wrong = new_map(true, 1.5), same = new_map(false, 1.0);
  CHECK(fits.first_used_s < 0.15);
  CHECK(fits.refused <= 1);
  CHECK(fits.used >= 48);
  CHECK(wrong.used == 0);
  CHECK(wrong.refused > 45);
  CHECK(wrong.largest < 2.0);
  CHECK(same.first_used_s > 0.9);  // one that contradicted has to fit for a second
}

TEST_CASE("a vision that is lost twice in a tunnel is told twice where to start again") {
  const NewMap m = new_map(true, 1.0);
  REQUIRE(!m.asked_at.empty());
  CHECK(m.asked_at.back() > 57.9);
  CHECK(m.asked_at.back() < 58.2);
  CHECK(m.restart_off < 5.0);  // by where the car has come within the picture or two since
}

/// The local pose half a second after a vision began at 30 m/s, whose first picture does not know its speed. An INS
/// that is not yet valid splits the steps.
Odometry begun_at_speed() {
  constexpr double kSpeed_mps = 30.0;
  Fusion fusion({});
  for (int i = 0; i <= 25; ++i) {
    ChannelSample s;
    s.odometry.t_us = 1'000'000 + 20'000 * i;
    fusion.set_gnss(s.odometry.t_us, false);
    s.odometry.cov_pose = 1e-6 * (1 + i) * Matrix6d::Identity();
    if (i % 5 == 0) {
      s.channel = FusionChannel::kVo;
      s.odometry.validity = Validity::kValid;
      s.odometry.T_frame_vehicle.p.x() = kSpeed_mps * 0.02 * i;
      s.odometry.velocity.x() = i > 0 ? kSpeed_mps : 0.0;
      s.odometry.cov_velocity = (i > 0 ? 0.01 : 1600.0) * Eigen::Matrix3d::Identity();
    } else {
      s.channel = FusionChannel::kIns;
    }
    (void)fusion.add(s);
  }
  return fusion.local();
}

TEST_CASE("a vision that begins in motion tells the local pose how far it came, and is believed") {
  const Odometry local = begun_at_speed();
  const double sigma = std::sqrt(local.cov_pose(0, 0));
  CHECK(std::abs(local.T_frame_vehicle.p.x() - 15.0) < 3.0 * sigma);
  CHECK(sigma < 0.3);  // teeth: the guess of the first step alone, whose speed nobody knew, is 2 m
  CHECK(std::sqrt(local.cov_pose(5, 5)) < 0.01);
}

}  // namespace
}  // namespace roadfix
