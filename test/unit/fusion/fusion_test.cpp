/// The assembled fusion on simulated drives: what the pose does and what the status says.
#include "fusion/fusion.h"

#include <catch2/catch.hpp>
#include <cmath>

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
using test::Watch;

TEST_CASE("vision carries the pose through a tunnel, where the INS alone drifts") {
  const Tunnel t;
  Fusion fusion({});
  Watch watch{t.drive, 95.0, 100.0};
  watch.words = "no GNSS";
  double ins = 0.0;
  run(fusion, t.events(), [&](const Fusion& f, const StreamEvent& e) {
    watch(f, e);
    if (e.sample.channel == FusionChannel::kIns && seconds(t.drive, e.sample.odometry.t_us) < 100.0)
      ins = std::max(ins, planar_error(t.drive, e.sample.odometry).distance());
  });
  CHECK(watch.largest < 1.5);
  CHECK(ins > 4.0);
  CHECK(watch.said);
  CHECK(fusion.channel(FusionChannel::kWheel).status == FuseStatus::kDisabled);  // they are in the INS already
}

TEST_CASE("the tie to ENU is found without a reference, frozen in an outage, and says how uncertain it is") {
  const Tunnel t;
  Fusion fusion({});
  const auto events = t.events();
  double scale_sigma_at_loss = 0.0, position_at_loss = 0.0, position_at_end = 0.0, yaw_error = 1.0;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    if (e.sample.channel != FusionChannel::kVo) return;
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    const SE3 tied = f.tie().to_enu(e.sample.odometry.T_frame_vehicle);
    const Odometry truth = t.drive.truth_at(e.sample.odometry.t_us);
    if (s > 39.0 && s < 39.95) {
      CHECK(!f.tie_frozen());
      CHECK((tied.p - truth.T_frame_vehicle.p).head<2>().norm() < 0.5);
      yaw_error = std::abs(yaw_of(tied.q) - yaw_of(truth.T_frame_vehicle.q));
      scale_sigma_at_loss = std::sqrt(f.tie().covariance()(FrameTie::kLogScale, FrameTie::kLogScale));
      position_at_loss = std::sqrt(f.tie().covariance()(0, 0));
    }
    if (s > 99.0 && s < 99.95) {
      CHECK(f.tie_frozen());
      position_at_end = std::sqrt(f.tie().covariance()(0, 0));
    }
  });
  CHECK(yaw_error < 0.01);
  CHECK(scale_sigma_at_loss < 0.02);
  CHECK(position_at_end > 2.0 * position_at_loss);
}

TEST_CASE("the vision's scale is learnt while GNSS is good, also where it has none") {
  for (const bool metric : {true, false}) {
    Tunnel t;
    t.vo.scale_std = metric ? 0.02 : 1.0;
    std::vector<StreamEvent> events = t.events();
    for (StreamEvent& e : events)
      if (e.sample.channel == FusionChannel::kVo) e.sample.metric = metric;
    const double way = [&] {
      const auto vo = vo_stream(t.drive, t.vo, 1);
      return vo.back().sample.odometry.velocity.norm() /
             std::max(1e-9, t.drive.truth_at(vo.back().sample.odometry.t_us).velocity.norm());
    }();
    Fusion fusion({});
    Watch watch{t.drive, 95.0, 100.0};
    std::optional<double> at_loss, sigma;
    run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
      watch(f, e);
      if (seconds(t.drive, e.sample.odometry.t_us) > 39.0 && !at_loss) {
        at_loss = f.estimate().x(kVoScale);
        sigma = std::sqrt(f.estimate().P(kVoScale, kVoScale));
      }
    });
    REQUIRE(at_loss);
    INFO("metric " << metric << " true " << std::log(way) << " learnt " << *at_loss << " +- " << *sigma);
    CHECK(std::abs(*at_loss - std::log(way)) < 4.0 * *sigma);
    CHECK(*sigma < 0.005);
    CHECK(watch.largest < 2.0);
  }
}

/// The tunnel with a vision that fails at 60 s.
struct Failure {
  double largest = 0.0;
  bool contradicts = false;
  std::optional<VisionRestart> restart;
  SE3 truth_at_restart;
};
Failure failing_vision(const std::function<bool(double, Planar&)>& fault) {
  Tunnel t;
  t.ins.velocity_walk = 0.005;  // an INS with wheels
  t.vo.fault = [&](double t_s, Planar& motion) { return t_s < 60.0 || fault(t_s, motion); };
  Fusion fusion({});
  Watch watch{t.drive, 60.0, 100.0};
  watch.words = "vision contradicts";
  Failure f;
  run(fusion, t.events(), [&](const Fusion& fused, const StreamEvent& e) {
    watch(fused, e);
    if (!fusion.asks_restart()) return;
    const VisionRestart restart = fusion.take_restart(fusion.fused());
    if (!f.restart) {
      f.restart = restart;
      f.truth_at_restart = fused.tie().to_vo(t.drive.truth_at(fused.t_us()).T_frame_vehicle);
    }
  });
  f.largest = watch.largest;
  f.contradicts = watch.said;
  return f;
}

TEST_CASE("vision that freezes, jumps in scale or drives off confidently is noticed, left alone and restarted") {
  const auto frozen = failing_vision([](double, Planar& m) {
    m.setZero();
    return true;
  });
  const auto scaled = failing_vision([](double, Planar& m) {
    m.head<2>() *= 1.5;
    return true;
  });
  const auto astray = failing_vision([](double, Planar& m) {
    m.y() += 0.3;
    return true;
  });
  for (const Failure& f : {frozen, scaled, astray}) {
    CHECK(f.largest < 3.0);
    CHECK(f.contradicts);
    REQUIRE(f.restart);
    CHECK((f.restart->T_vo_vehicle.p - f.truth_at_restart.p).head<2>().norm() < 3.0);
    CHECK(f.restart->reason == "vision disagrees with wheels and imu");
  }
}

TEST_CASE("vision that is believed in spite of it all leads astray: the test above has teeth") {
  Tunnel t;
  t.ins.velocity_walk = 0.005;
  t.vo.fault = [](double t_s, Planar& m) {
    if (t_s > 60.0) m.y() += 0.3;
    return true;
  };
  FusionConfig c;
  c.agreement.gate = c.gate = 1e9;
  Fusion fusion(c);
  Watch watch{t.drive, 60.0, 100.0};
  run(fusion, t.events(), [&](const Fusion& f, const StreamEvent& e) { watch(f, e); });
  CHECK(watch.largest > 10.0);
}

TEST_CASE("fixes 15 m off after the tunnel are refused, and it is said") {
  Tunnel t;
  t.ins.lie = [](double t_s) {
    return t_s > 100.0 && t_s < 106.0 ? Eigen::Vector2d(15.0, 0.0) : Eigen::Vector2d(0.0, 0.0);
  };
  Fusion fusion({});
  Watch watch{t.drive, 100.0, 106.0};
  watch.words = "GNSS/INS contradicts";
  run(fusion, t.events(), [&](const Fusion& f, const StreamEvent& e) { watch(f, e); });
  CHECK(watch.largest < 2.0);
  CHECK(watch.said);
  CHECK(planar_error(t.drive, fusion.fused()).distance() < 1.0);
}

TEST_CASE("without vision nobody can contradict the INS: the fusion gives way at once and makes it up evenly") {
  Tunnel t;
  t.ins.velocity_walk = 0.08;
  t.ins.claimed = 0.2;  // far off after the tunnel, and sure of it
  const auto events = ins_stream(t.drive, t.ins, 1);
  Fusion fusion({});
  double ins_before = 0.0, fused_later = 0.0, speed = 0.0;
  bool gave_way = false;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    if (s < 100.0) ins_before = planar_error(t.drive, e.sample.odometry).distance();
    gave_way = gave_way || f.channel(FusionChannel::kIns).status == FuseStatus::kReset;
    if (s > 104.0) fused_later = std::max(fused_later, planar_error(t.drive, f.fused()).distance());
    const double true_speed = t.drive.truth_at(e.sample.odometry.t_us).velocity.x();
    if (s > 102.0) speed = std::max(speed, std::abs(f.fused().velocity.x() - true_speed));
  });
  CHECK(ins_before > 5.0);
  CHECK(gave_way);
  CHECK(fused_later < 0.5);
  CHECK(speed < 0.5);
}

TEST_CASE("GNSS/INS killed and started again: vision and wheels carry on") {
  Tunnel t;
  t.ins.outages.clear();
  auto events = t.events();
  std::erase_if(events, [&](const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    return e.sample.channel == FusionChannel::kIns && s > 50.0 && s < 70.0;
  });
  Fusion fusion({});
  Watch dead{t.drive, 50.5, 70.0}, back{t.drive, 72.0, 119.0};
  dead.words = "no GNSS/INS";
  bool wheels_used = false;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    dead(f, e);
    back(f, e);
    wheels_used = wheels_used || f.channel(FusionChannel::kWheel).status == FuseStatus::kAccepted;
  });
  CHECK(dead.said);
  CHECK(dead.largest < 1.5);
  CHECK(back.largest < 0.5);
  CHECK(wheels_used);
}

TEST_CASE("weights tell who is used now: nothing is said of a channel that is silent or disabled") {
  Tunnel t;
  auto events = t.events();
  std::erase_if(events, [&](const StreamEvent& e) {  // wheels alone at first, vision from 10 s to 60 s
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    const FusionChannel c = e.sample.channel;
    return (c == FusionChannel::kIns && s < 5.0) || (c == FusionChannel::kVo && (s < 10.0 || s > 60.0));
  });
  Fusion fusion({});
  const auto weight = [&](FusionChannel c) { return fusion.channel(c).weight; };
  double seen = 0.0;
  run(fusion, events, [&](const Fusion&, const StreamEvent& e) {
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    if (s > 1.0 && s < 4.9) CHECK(weight(FusionChannel::kWheel) == 1.0);
    if (s < 5.5) return;
    CHECK(weight(FusionChannel::kWheel) == 0.0);
    CHECK(weight(FusionChannel::kIns) + weight(FusionChannel::kVo) == Approx(1.0));
    if (s > 50.0 && s < 60.0) seen = std::max(seen, weight(FusionChannel::kVo));
    if (s > 61.0) CHECK(weight(FusionChannel::kVo) == 0.0);
  });
  CHECK(seen > 0.1);
}

TEST_CASE("a return by more than the limit waits for three fixes, then jumps once, counted") {
  Tunnel t;
  t.ins.velocity_walk = 0.1;
  t.with_wheels = false;
  auto events = t.events();
  std::erase_if(events, [](const StreamEvent& e) { return e.sample.channel == FusionChannel::kVo; });
  Fusion fusion({});
  std::optional<Odometry> last;
  int steps = 0;
  double jumped_at = 0.0;
  run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
    const Odometry now = f.fused();
    const double s = seconds(t.drive, e.sample.odometry.t_us);
    if (last && s > 99.0) {
      const double step = (now.T_frame_vehicle.p - last->T_frame_vehicle.p).norm();
      if (step > 1.0) {
        ++steps;
        jumped_at = s;
      }
    }
    last = now;
  });
  CHECK(steps == 1);
  CHECK(jumped_at > 101.5);
  CHECK(jumped_at < 104.0);
  CHECK(fusion.report().reset_counter == 1);
  CHECK(fusion.report().last_jump.head<2>().norm() > 1.0);
  CHECK(planar_error(t.drive, fusion.fused()).distance() < 0.5);
}

TEST_CASE("the local pose never jumps, whatever the absolute one does") {
  Tunnel t;
  t.ins.velocity_walk = 0.1;
  t.with_wheels = false;
  Fusion fusion({});
  std::optional<Odometry> local;
  double worst = 0.0;
  run(fusion, t.events(), [&](const Fusion& f, const StreamEvent&) {
    const Odometry now = f.local();
    if (local) {
      const double dt = seconds_between(local->t_us, now.t_us);
      const Planar motion = motion_between(planar_pose(*local), planar_pose(now));
      worst = std::max(worst, std::abs(motion.head<2>().norm() - t.drive.truth_at(now.t_us).velocity.norm() * dt));
    }
    local = now;
  });
  CHECK(worst < 0.08);
}

TEST_CASE("two odometries of one gyro are not two witnesses of the yaw") {
  Tunnel t;
  t.with_wheels = false;
  t.vo.turns_std = 0.0;
  const auto yaw_sigma = [&](bool shared) {
    auto events = t.events();
    for (StreamEvent& e : events)
      if (e.sample.channel == FusionChannel::kVo) e.sample.shares_imu = shared;
    Fusion fusion({});
    double sigma = 0.0;
    run(fusion, events, [&](const Fusion& f, const StreamEvent& e) {
      if (seconds(t.drive, e.sample.odometry.t_us) < 99.0) sigma = std::sqrt(f.estimate().P(kYaw, kYaw));
    });
    return sigma;
  };
  CHECK(yaw_sigma(true) > 1.1 * yaw_sigma(false));
}

TEST_CASE("a snapshot goes on with the same bits; shifted times change none") {
  const Tunnel t;
  const auto events = t.events();
  Fusion whole({}), resumed({}), shifted({});
  std::size_t i = 0;
  for (const StreamEvent& e : events) {
    whole.set_gnss(e.sample.odometry.t_us, e.gnss);
    (void)whole.add(e.sample);
    StreamEvent later = e;
    later.sample.odometry.t_us += 1'234'567;
    shifted.set_gnss(later.sample.odometry.t_us, e.gnss);
    (void)shifted.add(later.sample);
    if (i == events.size() / 2) {
      StateWriter writer;
      whole.save(writer);
      const std::vector<uint8_t> bytes = writer.take();
      StateReader reader(bytes);
      resumed.load(reader);
      reader.finish();
    } else if (i > events.size() / 2) {
      resumed.set_gnss(e.sample.odometry.t_us, e.gnss);
      (void)resumed.add(e.sample);
    }
    ++i;
  }
  for (const Fusion* other : {&resumed, &shifted}) {
    CHECK(other->estimate().x == whole.estimate().x);
    CHECK(other->estimate().P == whole.estimate().P);
    CHECK(other->local().T_frame_vehicle.p == whole.local().T_frame_vehicle.p);
  }
}

TEST_CASE("old and broken samples change nothing and are called by their name") {
  const Tunnel t;
  const auto events = t.events();
  Fusion fusion({});
  for (std::size_t i = 0; i < 500; ++i) (void)fusion.add(events[i].sample);
  const FusionEstimate before = fusion.estimate();
  CHECK(fusion.add(events[100].sample) == FuseStatus::kNotReady);
  ChannelSample broken = events[500].sample;
  broken.odometry.cov_pose(0, 0) = std::nan("");
  CHECK(fusion.add(broken) == FuseStatus::kBadInput);
  CHECK(fusion.estimate().x == before.x);
  CHECK(fusion.estimate().P == before.P);
}

}  // namespace
}  // namespace roadfix
