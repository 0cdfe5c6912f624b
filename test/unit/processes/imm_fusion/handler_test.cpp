#include "imm_fusion/handler.h"

#include <catch2/catch.hpp>
#include <roadfix/aiding_t.hpp>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/vo_restart_t.hpp>

#include "fusion/planar.h"
#include "fusion_wire.h"
#include "geodesy/enu_change.h"
#include "geometry/frames.h"
#include "simulation/scenarios.h"

namespace roadfix {
namespace {

using namespace test;

const SimulatedDrive& drive() {
  static const SimulatedDrive kDrive = [] {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 60.0;
    s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
    s.mag.rate_hz = 0.0;
    return simulate(s, 3);
  }();
  return kDrive;
}

double seconds(int64_t t_us) { return seconds_between(drive().config.start_utime, t_us); }

/// GNSS/INS with an outage from 30 s on, vision and wheels.
std::vector<StreamEvent> events(const test::VoNoise& vision = {}) {
  test::InsNoise ins;
  ins.rate_hz = 100.0;
  ins.outages = {{30.0, 55.0}};
  test::VoNoise wheels;
  wheels.rate_hz = 50.0;
  return test::merged(
      {ins_stream(drive(), ins, 1), test::vo_stream(drive(), vision, 1), wheel_stream(drive(), wheels, 1)});
}

std::vector<Arrival> arrivals(const std::function<bool(const StreamEvent&)>& there, int64_t late_us = 0) {
  Wire wire(late_us);
  for (const StreamEvent& e : events())
    if (there(e)) wire.put(e);
  return wire.take();
}

constexpr int64_t kVisionAge_us = 300'000;  // more than what vision waits for

bool everything(const StreamEvent&) { return true; }

double distance(const pose_t& m) {
  const Odometry truth = drive().truth_at(m.utime);
  return (odometry(m).T_frame_vehicle.p - truth.T_frame_vehicle.p).head<2>().norm();
}

TEST_CASE("poses are for now, in ENU, and what is inside is told") {
  const auto messages = arrivals(everything);
  const Caught out = run(messages);
  const auto fused = out.all<pose_t>("POSE_FUSED");
  std::vector<int64_t> ins_utimes;
  for (const Arrival& a : messages)
    if (a.channel == "POSE_INS") ins_utimes.push_back(a.header.utime);
  REQUIRE(fused.size() == ins_utimes.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < fused.size(); ++i) {
    REQUIRE(fused[i].utime == ins_utimes[i]);
    if (seconds(fused[i].utime) > 1.0) largest = std::max(largest, distance(fused[i]));
  }
  CHECK(largest < 6.0);  // the INS's own, 25 s without fixes
  const pose_t& last = fused.back();
  CHECK(last.frame == pose_t::FRAME_ENU);
  CHECK(last.anchor_lat_deg == Approx(kAnchor_deg[0]));
  CHECK(last.validity == pose_t::VALIDITY_VALID);
  CHECK(fused[4000].validity == pose_t::VALIDITY_COASTING);
  CHECK(fused[4000].reason == "no GNSS");
  CHECK(fused.front().validity == pose_t::VALIDITY_INVALID);
  CHECK(fused.front().reason == "waits for a pose");

  const auto states = out.all<fusion_state2_t>("FUSION_STATE");
  REQUIRE(states.size() > 590);
  const fusion_state2_t& state = states[400];
  CHECK(state.mode_name == std::vector<std::string>{"constant_acceleration", "constant_turn"});
  CHECK(state.mode_probability[0] + state.mode_probability[1] == Approx(1.0));
  CHECK(state.channel_name == std::vector<std::string>{"POSE_INS", "POSE_VO", "POSE_WHEEL"});
  CHECK(state.channel_health == std::vector<int8_t>(3, fusion_state2_t::HEALTH_GOOD));
  CHECK(state.source == fusion_state2_t::SOURCE_INS);
  CHECK(!state.leader.empty());
  CHECK(state.reason == "no GNSS");
  CHECK(state.channel_weight[0] + state.channel_weight[1] + state.channel_weight[2] == Approx(1.0));
  CHECK(state.channel_scale_std[1] < 0.005);  // of 0.01: learnt
  CHECK(!state.tie_valid);                    // the literal scheme's

  const auto aidings = out.all<aiding_t>("AIDING_FUSION");
  REQUIRE(aidings.size() > 8000);
  const auto of_ins = std::find_if(aidings.begin() + 5000, aidings.end(),
                                   [](const aiding_t& a) { return a.source == aiding_t::SOURCE_POSE_INS; });
  const aiding_t& aiding = *of_ins;
  CHECK(aiding.status == aiding_t::STATUS_ACCEPTED);
  REQUIRE(aiding.dof == 3);
  CHECK(*std::min_element(aiding.innovation_variance.begin(), aiding.innovation_variance.end()) > 0.0);
}

TEST_CASE("a pose for now is the later pose of the horizon, but for what the channels say meanwhile") {
  const Caught out = run(arrivals(everything));
  double largest = 0.0, step = 0.0;
  std::optional<pose_t> before;
  for (const pose_t& m : out.all<pose_t>("POSE_LOCAL")) {
    if (before && seconds(m.utime) > 1.0) {
      const Eigen::Vector3d moved = odometry(m).T_frame_vehicle.p - odometry(*before).T_frame_vehicle.p;
      const double driven =
          (drive().truth_at(m.utime).T_frame_vehicle.p - drive().truth_at(before->utime).T_frame_vehicle.p).norm();
      step = std::max(step, std::abs(moved.norm() - driven));
    }
    before = m;
  }
  for (const pose_t& m : out.all<pose_t>("POSE_FUSED")) {
    const double t = seconds(m.utime);
    if (t > 5.0 && t < 30.0) largest = std::max(largest, distance(m));
  }
  CHECK(step < 0.05);  // POSE_LOCAL never jumps, not by the carrying forward either
  CHECK(largest < 0.35);
}

TEST_CASE("late messages give the same bits, beyond the lateness they are refused, and that shows") {
  const Caught in_order = run(arrivals(everything));
  const Caught late = run(arrivals(everything, 45'000));
  for (const auto& [channel, messages] : in_order.messages) {
    if (channel.starts_with("STATE_")) continue;  // holds what the stream has seen ahead of the horizon, too
    CAPTURE(channel);
    const auto& others = late.messages.at(channel);
    REQUIRE(messages.size() == others.size());
    const auto differs = std::mismatch(messages.begin(), messages.end(), others.begin()).first;
    CAPTURE(differs - messages.begin());
    CHECK(differs == messages.end());
  }
  CHECK(in_order.messages != run(arrivals(everything, 400'000)).messages);
}

TEST_CASE("a stage that begins at a snapshot publishes what the one that never stopped publishes") {
  const std::vector<Arrival> messages = arrivals(everything);
  const Caught whole = run(messages);
  const auto states = whole.all<state_t>("STATE_IMM_FUSION");
  REQUIRE(states.size() >= 5);
  for (const state_t& state : {states[1], states[4]}) {
    Caught rest;
    StageRunner resumed(make_imm_fusion(Calibration{}, ImmFusionConfig{}), rest);
    resumed.resume(state);
    for (const Arrival& a : messages)
      if (a.header.utime > state.horizon_utime - kVisionAge_us) offer(resumed, a);  // what is in the state is left out
    for (const std::string channel : {"POSE_FUSED", "POSE_LOCAL", "FUSION_STATE", "AIDING_FUSION"}) {
      CAPTURE(channel);
      const auto& all = whole.messages.at(channel);
      const auto& again = rest.messages.at(channel);
      REQUIRE(again.size() > 100);
      REQUIRE(again.size() < all.size());
      CHECK(std::equal(again.begin(), again.end(), all.end() - static_cast<std::ptrdiff_t>(again.size())));
    }
  }
  Caught ignored;
  StageRunner other(make_imm_fusion(Calibration{}, ImmFusionConfig{}), ignored);
  state_t cut = states[1];
  cut.state.resize(cut.state.size() - 1);
  CHECK_THROWS(other.resume(cut));
}

TEST_CASE("the paper's scheme is selectable: POSE_FUSED is its pose, and a snapshot holds it") {
  ImmFusionConfig literal;
  literal.scheme = FusionScheme::kLiteral;
  const auto messages = arrivals(everything);
  const Caught out = run(messages, literal), by_default = run(messages);
  double largest = 0.0;
  for (const pose_t& m : out.all<pose_t>("POSE_FUSED"))
    if (seconds(m.utime) > 2.0) largest = std::max(largest, distance(m));
  CHECK(largest < 5.0);
  CHECK(out.messages.at("POSE_FUSED") != by_default.messages.at("POSE_FUSED"));
  CHECK(out.messages.at("POSE_LOCAL").size() == by_default.messages.at("POSE_LOCAL").size());
  const auto states = out.all<fusion_state2_t>("FUSION_STATE");
  CHECK(states[400].source == fusion_state2_t::SOURCE_LITERAL);
  CHECK(states[400].tie_valid);
  CHECK(states[400].tie_frozen);
  CHECK(!states[200].tie_frozen);
  CHECK(states[200].channel_alpha[1] == Approx(LiteralConfig{}.adaptive.alpha_vio));
  CHECK(states[400].channel_alpha[1] < 0.95 * LiteralConfig{}.adaptive.alpha_vio);  // ramped, but for its residuals

  const state_t state = out.all<state_t>("STATE_IMM_FUSION")[3];
  Caught rest;
  StageRunner resumed(make_imm_fusion(Calibration{}, literal), rest);
  resumed.resume(state);
  for (const Arrival& a : messages)
    if (a.header.utime > state.horizon_utime - kVisionAge_us) offer(resumed, a);  // what is in the state is left out
  const auto &all = out.messages.at("POSE_FUSED"), &again = rest.messages.at("POSE_FUSED");
  REQUIRE(again.size() > 100);
  CHECK(std::equal(again.begin(), again.end(), all.end() - static_cast<std::ptrdiff_t>(again.size())));
}

TEST_CASE("without GNSS the fused pose is in a local frame and usable, darkness brings a restart at the carried pose") {
  const Caught out = run([] {
    Wire wire;
    for (StreamEvent e : events()) {
      const double t = seconds(e.sample.odometry.t_us);
      // An INS that never aligns is the clock all the same.
      if (e.sample.channel == FusionChannel::kIns) e.sample.odometry.validity = Validity::kInvalid;
      if (e.sample.channel == FusionChannel::kVo && t > 30.0 && t < 38.0)
        e.sample.odometry.validity = Validity::kInvalid;
      wire.put(e);
    }
    return wire.take();
  }());
  for (const pose_t& m : out.all<pose_t>("POSE_FUSED")) {
    CHECK(m.frame == pose_t::FRAME_LOCAL);
    if (seconds(m.utime) < 6.0) continue;
    REQUIRE(m.validity == pose_t::VALIDITY_COASTING);
    CHECK(m.state == pose_t::STATE_WEAK);
    CHECK(m.reason.starts_with("no absolute pose yet: local frame"));
    CHECK(m.reset_counter == 0);
  }
  const auto restarts = out.all<vo_restart_t>("VO_RESTART");
  REQUIRE(restarts.size() == 2);
  CHECK(seconds(restarts[1].utime) - seconds(restarts[0].utime) >= FusionConfig{}.restart_every);
  for (const vo_restart_t& r : restarts) {
    Odometry vision;
    for (const StreamEvent& e : events())
      if (e.sample.channel == FusionChannel::kVo && e.sample.odometry.t_us <= r.utime) vision = e.sample.odometry;
    CHECK((Eigen::Vector3d(r.restart_position_m) - vision.T_frame_vehicle.p).head<2>().norm() < 3.0);
  }
}

TEST_CASE("a dead channel leaves the others' result") {
  const auto without = [](FusionChannel dead, double from_s) {
    return run(arrivals(
        [=](const StreamEvent& e) { return e.sample.channel != dead || seconds(e.sample.odometry.t_us) < from_s; }));
  };
  const Caught whole = run(arrivals(everything));
  // Wheels are in the INS already: their death changes not a bit.
  const Caught no_wheels = without(FusionChannel::kWheel, 20.0);
  const auto positions = [](const Caught& c) {
    std::vector<Eigen::Vector3d> p;
    for (const pose_t& m : c.all<pose_t>("POSE_FUSED")) p.push_back(odometry(m).T_frame_vehicle.p);
    return p;
  };
  CHECK(positions(whole) == positions(no_wheels));

  // Vision that dies leaves the INS and its drift; an INS that dies leaves vision, which then is the clock; and last
  // the wheels.
  double ins = 0.0;
  for (const Arrival& a : arrivals(everything)) {
    if (a.channel == "POSE_INS" && seconds(a.header.utime) > 1.0)
      ins = std::max(ins, distance(decode<pose_t>(a.bytes)));
  }
  struct Death {
    FusionChannel dead;
    double from_s, error;
    std::size_t least_poses;
  };
  for (const Death& d :
       {Death{FusionChannel::kVo, 20.0, 1.05 * ins, 5990}, Death{FusionChannel::kIns, 40.0, 2.0, 4150}}) {
    const auto poses = without(d.dead, d.from_s).all<pose_t>("POSE_FUSED");
    REQUIRE(poses.size() >= d.least_poses);
    double largest = 0.0;
    for (const pose_t& m : poses) {
      if (seconds(m.utime) < 1.0) continue;
      REQUIRE(m.validity != pose_t::VALIDITY_INVALID);
      largest = std::max(largest, distance(m));
    }
    CHECK(largest < d.error);
    CHECK(seconds(poses.back().utime) > 59.8);
  }
}

TEST_CASE("an INS that starts again with another anchor is taken to the first one's frame") {
  Wire wire;
  const Geodetic first{kAnchor_deg[0] * kDegree, kAnchor_deg[1] * kDegree, 0.0};
  const Geodetic second{37.501 * kDegree, 127.001 * kDegree, 12.0};
  const SE3 T_second_first = T_enu_enu(second, first);
  std::vector<Arrival> messages;
  Wire later(0, 2);
  for (const StreamEvent& e : events()) {
    if (e.sample.channel != FusionChannel::kIns) continue;
    const double t = seconds(e.sample.odometry.t_us);
    if (t < 15.0) wire.put(e);
    if (t < 17.0 || t > 25.0) continue;
    pose_t m{};
    fill_pose(in_other_frame(T_second_first, e.sample.odometry), m);
    m.frame = pose_t::FRAME_ENU;
    m.scale = pose_t::SCALE_METRIC;
    m.anchor_lat_deg = 37.501;
    m.anchor_lon_deg = 127.001;
    m.anchor_height_m = 12.0;
    later.put("POSE_INS", e.sample.odometry.t_us, m);
  }
  messages = wire.take();
  for (const Arrival& a : later.take()) messages.push_back(a);
  const auto poses = run(messages).all<pose_t>("POSE_FUSED");
  CHECK(seconds(poses.back().utime) > 24.9);
  CHECK(poses.back().anchor_lat_deg == Approx(kAnchor_deg[0]));
  CHECK(distance(poses.back()) < 0.5);
}

TEST_CASE("vision that says it is lost is asked to start again, in its own frame") {
  const Caught out = run([] {
    Wire wire;
    for (StreamEvent e : events()) {
      const double t = seconds(e.sample.odometry.t_us);
      if (e.sample.channel == FusionChannel::kVo && t > 40.0) e.sample.odometry.validity = Validity::kInvalid;
      wire.put(e);
    }
    return wire.take();
  }());
  const auto restarts = out.all<vo_restart_t>("VO_RESTART");
  REQUIRE(restarts.size() >= 3);
  const vo_restart_t& r = restarts.front();
  CHECK(seconds(r.utime) > 40.0);
  CHECK(seconds(r.utime) < 41.0);
  CHECK(!r.reason.empty());
  // The pose that vision itself had at that moment, as its stream goes on unharmed behind the flag; not the horizon's.
  Odometry vision;
  for (const StreamEvent& e : events())
    if (e.sample.channel == FusionChannel::kVo && e.sample.odometry.t_us <= r.utime) vision = e.sample.odometry;
  const Eigen::Vector3d p(r.restart_position_m), step = vision.T_frame_vehicle.q * vision.velocity;
  const Eigen::Vector3d expected = vision.T_frame_vehicle.p + seconds_between(vision.t_us, r.utime) * step;
  CHECK((p - expected).head<2>().norm() < 0.2);
  CHECK((p - expected + 0.2 * step).head<2>().norm() > 0.2);  // teeth: vision's own age
}

}  // namespace
}  // namespace roadfix
