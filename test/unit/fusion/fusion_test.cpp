/// The assembled fusion on simulated drives: what the pose does and what the status says.
#include "fusion/fusion.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "geometry/euler.h"
#include "tunnel.h"

namespace roadfix {
namespace {

using test::planar_error;
using test::run;
using test::seconds;
using test::StreamEvent;
using test::Tunnel;
using test::Watch;

double time_of(const Tunnel& t, const StreamEvent& e) { return seconds(t.drive, e.sample.odometry.t_us); }

TEST_CASE("a healthy INS is what the fusion gives, through an outage as well, to the bit") {
  const Tunnel t;
  Fusion fusion({});
  int compared = 0;
  run(fusion, t.events(), [&](const FusedPoses& f, const StreamEvent& e) {
    if (e.sample.channel != FusionChannel::kIns) return;
    REQUIRE(f.fused.T_frame_vehicle.p == e.sample.odometry.T_frame_vehicle.p);
    REQUIRE(f.fused.cov_pose == e.sample.odometry.cov_pose);
    REQUIRE(f.report.follows_ins);
    const double s = time_of(t, e);
    if (s > 1.0 && s < 39.0) CHECK(f.report.reason.empty());
    if (s > 41.0 && s < 99.0) CHECK(f.report.reason == "no GNSS");
    ++compared;
  });
  CHECK(compared > 5000);
}

TEST_CASE("the scales of vision and wheels are learnt while GNSS is good, also where there is none") {
  for (const bool metric : {true, false}) {
    Tunnel t;
    t.vo.scale_std = metric ? 0.02 : 1.0;
    std::vector<StreamEvent> events = t.events();
    for (StreamEvent& e : events)
      if (e.sample.channel == FusionChannel::kVo) e.sample.metric = metric;
    const auto alone = vo_stream(t.drive, t.vo, 1);
    const double way = alone.back().sample.odometry.velocity.norm() /
                       t.drive.truth_at(alone.back().sample.odometry.t_us).velocity.norm();
    Fusion fusion({});
    run(fusion, events, [](const FusedPoses&, const StreamEvent&) {});
    CAPTURE(metric, way);
    CHECK(fusion.channel(FusionChannel::kVo).calibration().length() == Approx(1.0 / way).epsilon(3e-3));
    CHECK(fusion.channel(FusionChannel::kVo).good(fusion.t_us()));
  }
}

/// A fault of one channel from 60 s to 90 s of a drive with fixes (or without, from 40 s on).
struct Fault {
  const char* name;
  FusionChannel channel;
  std::function<bool(StreamEvent&, double since_s)> apply;  ///< false: the sample is not there
  const char* words;                                        ///< that the reason has
  double largest;                                           ///< m, of POSE_FUSED while it lasts
};

bool gone(StreamEvent&, double) { return false; }
bool says_invalid(StreamEvent& e, double) {
  e.sample.odometry.validity = Validity::kInvalid;
  return true;
}
bool lies(StreamEvent& e, double since_s) {  // drives off to the left
  e.sample.odometry.T_frame_vehicle.p += Eigen::Vector3d(2.0 * since_s, 3.0 * since_s, 0.0);
  return true;
}
bool says_nan(StreamEvent& e, double) {
  e.sample.odometry.T_frame_vehicle.p.x() = std::nan("");
  return true;
}

/// Samples of `channel` repeat what the first one in the fault said.
struct Freeze {
  std::optional<Odometry> first;
  bool operator()(StreamEvent& e, double) {
    if (!first) first = e.sample.odometry;
    const int64_t t_us = e.sample.odometry.t_us;
    e.sample.odometry = *first;
    e.sample.odometry.t_us = t_us;
    return true;
  }
};

std::vector<StreamEvent> with(std::vector<StreamEvent> events, const Tunnel& t, const std::vector<Fault>& faults) {
  std::vector<StreamEvent> kept;
  std::vector<Fault> state = faults;
  for (StreamEvent& e : events) {
    const double s = time_of(t, e);
    bool there = true;
    for (Fault& f : state)
      if (e.sample.channel == f.channel && s >= 60.0 && s < 90.0) there = there && f.apply(e, s - 60.0);
    if (there) kept.push_back(e);
  }
  return kept;
}

const std::vector<Fault>& faults() {
  using enum FusionChannel;
  static const std::vector<Fault> kFaults = {
      {"INS dead", kIns, gone, "POSE_INS is silent", 2.5},
      {"INS invalid", kIns, says_invalid, "POSE_INS is invalid", 2.5},
      {"INS frozen", kIns, Freeze{}, "POSE_INS", 5.0},
      {"INS lies", kIns, lies, "POSE_INS contradicts POSE_VO and POSE_WHEEL", 8.0},
      {"INS broken", kIns, says_nan, "POSE_INS is silent", 2.5},
      {"vision dead", kVo, gone, "", 0.5},
      {"vision frozen", kVo, Freeze{}, "", 0.5},
      {"vision lies", kVo, lies, "POSE_VO contradicts", 0.5},
      {"wheels dead", kWheel, gone, "", 0.5},
      {"wheels frozen", kWheel, Freeze{}, "", 0.5},
      {"wheels lie", kWheel, lies, "POSE_WHEEL contradicts", 0.5},
  };
  return kFaults;
}

TEST_CASE("each channel dead, frozen, lying: the pose stays, says why, and comes back") {
  for (const Fault& fault : faults()) {
    Tunnel t;
    t.ins.outages.clear();
    Fusion fusion({});
    Watch in{t.drive, 60.0, 90.0}, after{t.drive, 95.0, 119.0};
    in.words = fault.words;
    run(fusion, with(t.events(), t, {fault}), [&](const FusedPoses& f, const StreamEvent& e) {
      in(f, e);
      after(f, e);
    });
    CAPTURE(fault.name, in.largest, after.largest);
    CHECK(in.largest < fault.largest);
    CHECK((in.said || in.words.empty()));
    CHECK(in.always_usable);
    CHECK(after.largest < 1.0);
    CHECK(fusion.failover().follows());
  }
}

TEST_CASE("pairs of faults: what is left carries the pose, and nothing far off is called valid") {
  const auto& all = faults();
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t j = i + 1; j < all.size(); ++j) {
      if (all[i].channel == all[j].channel) continue;
      Tunnel t;
      t.ins.outages.clear();
      Fusion fusion({});
      double worst_valid = 0.0, after = 0.0, worst_ratio = 0.0;
      const bool ins_bad = all[i].channel == FusionChannel::kIns;
      const bool two_lie =
          std::string(all[i].name).ends_with("lies") && std::string(all[j].name).find("lie") != std::string::npos;
      run(fusion, with(t.events(), t, {all[i], all[j]}), [&](const FusedPoses& f, const StreamEvent& e) {
        const double s = time_of(t, e), off = planar_error(t.drive, f.fused).distance();
        if (s > 60.0 && f.fused.validity == Validity::kValid) worst_valid = std::max(worst_valid, off);
        if (s > 95.0) after = std::max(after, off);
        if (s > 65.0 && s < 90.0) {
          const double sigma = std::sqrt(f.fused.cov_pose.topLeftCorner<2, 2>().trace());
          worst_ratio = std::max(worst_ratio, off / (sigma + 1.0));
        }
      });
      CAPTURE(all[i].name, all[j].name, worst_valid, after, worst_ratio);
      // An INS that lies beside one witness alone cannot be found out: nobody knows who is right.
      const bool undecided = ins_bad && std::string(all[i].name) == "INS lies";
      if (!undecided && !two_lie) CHECK(worst_valid < 6.0);
      CHECK(after < 1.0);
    }
  }
}

TEST_CASE("late samples of one channel are refused, and nothing else changes") {
  Tunnel t;
  std::vector<StreamEvent> events = t.events();
  Fusion fusion({});
  int refused = 0;
  for (const StreamEvent& e : events) {
    (void)fusion.add(e.sample);
    ChannelSample late = e.sample;
    late.odometry.t_us -= 1'000'000;
    if (fusion.add(late) == FuseStatus::kNotReady) ++refused;
    (void)fusion.publish({});
  }
  CHECK(refused > 6000);
  CHECK(planar_error(t.drive, fusion.publish({}).fused).distance() < 0.5);
}

TEST_CASE(
    "an INS that corrects itself by 30 m while no fix comes is not followed; with one it is, and it is announced") {
  for (const bool fix : {false, true}) {
    Tunnel t;
    t.ins.velocity_walk = 0.005;
    std::vector<StreamEvent> events = t.events();
    for (StreamEvent& e : events) {
      const double s = time_of(t, e);
      if (e.sample.channel != FusionChannel::kIns || s < 60.0) continue;
      if (fix && s < 71.0) e.sample.odometry.cov_pose.topLeftCorner<2, 2>().diagonal().array() += 400.0;  // it said so
      if (s < 70.0) continue;
      e.sample.odometry.T_frame_vehicle.p.x() += 30.0;
      e.gnss = e.gnss || fix;
    }
    Fusion fusion({});
    double largest = 0.0, off_fixed = 0.0;
    int before = 0, at_end = 0;
    std::string words;
    run(fusion, events, [&](const FusedPoses& f, const StreamEvent& e) {
      const double s = time_of(t, e);
      if (s < 69.9) before = f.report.reset_counter;
      if (s > 70.5 && s < 79.0) {
        largest = std::max(largest, planar_error(t.drive, f.fused).distance());
        words = f.report.reason;
        at_end = f.report.reset_counter;
        off_fixed = planar_error(t.drive, f.fused).distance();
      }
    });
    CAPTURE(fix, largest, words);
    if (fix) {
      CHECK(off_fixed > 25.0);
      CHECK(at_end == before + 1);
    } else {
      CHECK(largest < 2.0);
      CHECK(words.find("POSE_INS corrected itself without a fix") != std::string::npos);
      CHECK(at_end == before);
    }
  }
}

TEST_CASE("half a second of an invalid INS does not freeze the pose, with witnesses or alone") {
  for (const bool alone : {false, true}) {
    Tunnel t;
    t.ins.outages.clear();
    std::vector<StreamEvent> events = t.events();
    if (alone) std::erase_if(events, [](const StreamEvent& e) { return e.sample.channel != FusionChannel::kIns; });
    for (StreamEvent& e : events) {
      const double s = time_of(t, e);
      if (e.sample.channel == FusionChannel::kIns && s > 60.0 && s < 60.5)
        e.sample.odometry.validity = Validity::kInvalid;
    }
    Fusion fusion({});
    Watch in{t.drive, 60.0, 61.2}, after{t.drive, 62.5, 119.0};
    std::vector<Validity> validities;
    run(fusion, events, [&](const FusedPoses& f, const StreamEvent& e) {
      in(f, e);
      after(f, e);
      if (time_of(t, e) > 60.05 && time_of(t, e) < 60.9) validities.push_back(f.fused.validity);
    });
    CAPTURE(alone, in.largest);
    CHECK(in.largest < (alone ? 2.0 : 0.8));
    CHECK(after.largest < 0.5);
    // Not valid while the INS is not, and not at once again.
    for (const Validity v : validities) CHECK(v == Validity::kCoasting);
  }
}

TEST_CASE("the INS gone and alone: coasting, then invalid, and valid again when it is back") {
  Tunnel t;
  t.ins.outages.clear();
  std::vector<StreamEvent> events = t.events();
  std::erase_if(events, [&](const StreamEvent& e) { return e.sample.channel != FusionChannel::kIns; });
  Fusion fusion({});
  int64_t now_us = 0;
  for (const StreamEvent& e : events) {
    if (time_of(t, e) > 60.0) break;
    (void)fusion.add(e.sample);
    now_us = e.sample.odometry.t_us;
  }
  ChannelSample invalid = events.front().sample;
  invalid.odometry.validity = Validity::kInvalid;
  Validity at_1s = Validity::kValid, at_5s = Validity::kValid;
  for (int i = 1; i <= 50; ++i) {
    invalid.odometry.t_us = now_us + i * 100'000;
    (void)fusion.add(invalid);
    (i < 15 ? at_1s : at_5s) = fusion.publish({}).fused.validity;
  }
  CHECK(at_1s == Validity::kCoasting);
  CHECK(at_5s == Validity::kInvalid);
  Validity last = Validity::kInvalid;
  for (const StreamEvent& e : events) {
    if (e.sample.odometry.t_us <= now_us + 5'000'000) continue;
    fusion.set_gnss(e.sample.odometry.t_us, true);
    (void)fusion.add(e.sample);
    last = fusion.publish({}).fused.validity;
  }
  CHECK(last == Validity::kValid);
}

TEST_CASE("POSE_LOCAL never jumps, whatever the fixes do to the INS") {
  Tunnel t;
  t.ins.lie = [](double t_s) { return Eigen::Vector2d(t_s > 100.0 ? 8.0 : 0.0, 0.0); };
  for (const bool with_ins : {true, false}) {
    std::vector<StreamEvent> events = t.events();
    if (!with_ins) std::erase_if(events, [](const StreamEvent& e) { return e.sample.channel == FusionChannel::kIns; });
    Fusion fusion({});
    std::optional<Odometry> last;
    double largest = 0.0;
    run(fusion, events, [&](const FusedPoses& f, const StreamEvent&) {
      if (last && f.local.t_us > last->t_us) {
        const double driven =
            (t.drive.truth_at(f.local.t_us).T_frame_vehicle.p - t.drive.truth_at(last->t_us).T_frame_vehicle.p).norm();
        largest = std::max(largest, std::abs((f.local.T_frame_vehicle.p - last->T_frame_vehicle.p).norm() - driven));
      }
      last = f.local;
    });
    CAPTURE(with_ins);
    CHECK(largest < 0.1);
  }
}

TEST_CASE("without GNSS POSE_FUSED is a pose in the local frame that says so; the first pose in ENU is announced") {
  const Tunnel t;
  std::vector<StreamEvent> events = t.events();
  std::erase_if(events,
                [&](const StreamEvent& e) { return e.sample.channel == FusionChannel::kIns && time_of(t, e) < 30.0; });
  Fusion fusion({});
  int before = 0;
  run(fusion, events, [&](const FusedPoses& f, const StreamEvent& e) {
    const double s = time_of(t, e);
    if (s > 5.0 && s < 29.9) {
      CHECK(!f.report.enu);
      CHECK(f.fused.validity == Validity::kCoasting);
      CHECK(f.fused.T_frame_vehicle.p == f.local.T_frame_vehicle.p);
      CHECK(f.report.reason.find("local frame") != std::string::npos);
      before = f.report.reset_counter;
    }
    if (s > 30.1) {
      CHECK(f.report.enu);
      if (s < 40.0) CHECK(planar_error(t.drive, f.fused).distance() < 0.5);
      if (s < 32.0) CHECK(f.report.reset_counter == before + 1);
    }
  });
  CHECK(before == 0);
}

/// Vision in the dark from 40 s to 48 s, without GNSS or INS, its own place lost; back with another map.
struct Dark {
  Tunnel t;
  std::vector<StreamEvent> events;
  explicit Dark(bool restarts) {
    events = t.events();
    std::erase_if(events, [](const StreamEvent& e) { return e.sample.channel == FusionChannel::kIns; });
    for (StreamEvent& e : events) {
      const double s = time_of(t, e);
      if (e.sample.channel != FusionChannel::kVo || s < 40.0) continue;
      if (s < 48.0) e.sample.odometry.validity = Validity::kInvalid;
      if (s >= 48.0 && restarts) {
        ++e.sample.reset_counter;
        e.sample.odometry.T_frame_vehicle.p += Eigen::Vector3d(-60.0, 5.0, 0.0);
      }
    }
  }
};

TEST_CASE("darkness without GNSS: wheels carry, vision is asked to start at the carried pose, and is checked") {
  const Dark dark(true);
  Fusion fusion({});
  std::optional<VisionRestart> restart;
  double restart_s = 0.0, local_error = 0.0;
  std::optional<Planar> start, truth_start;
  Odometry vo_truth;  // where vision, had it seen on, would be
  ChannelState just_back = ChannelState::kGood, later = ChannelState::kSilent;
  const auto unbroken = vo_stream(dark.t.drive, dark.t.vo, 1);
  run(fusion, dark.events, [&](const FusedPoses& f, const StreamEvent& e) {
    const double s = time_of(dark.t, e);
    if (fusion.asks_restart() && !restart) {
      restart = fusion.take_restart(f.local);
      restart_s = s;
      for (const StreamEvent& u : unbroken)
        if (u.sample.odometry.t_us <= f.local.t_us) vo_truth = u.sample.odometry;
    }
    const Planar local = planar_pose(f.local), truth = planar_pose(dark.t.drive.truth_at(f.local.t_us));
    if (s > 39.5 && !start) {
      start = local;
      truth_start = truth;
    }
    if (start && s > 60.0)
      local_error =
          std::max(local_error, (motion_between(*start, local) - motion_between(*truth_start, truth)).head<2>().norm());
    if (s > 48.15 && s < 48.3) just_back = fusion.channel(FusionChannel::kVo).state(fusion.t_us());
    if (s > 55.0) later = fusion.channel(FusionChannel::kVo).state(fusion.t_us());
  });
  REQUIRE(restart);
  CHECK(restart_s > 40.4);
  CHECK(restart_s < 48.5);
  CHECK((restart->T_vo_vehicle.p - vo_truth.T_frame_vehicle.p).head<2>().norm() < 3.0);
  CHECK(restart->reason == "vision says that it is lost");
  CHECK(just_back == ChannelState::kOnTrial);
  CHECK(later == ChannelState::kGood);
  CHECK(local_error < 12.0);  // over 80 s with wheels 1 % long: their scale is nobody's to know here
}

TEST_CASE("the order of samples of one time makes no difference that counts") {
  const Tunnel t;
  std::vector<StreamEvent> events = t.events(), permuted = events;
  for (std::size_t i = 1; i < permuted.size(); ++i) {
    if (permuted[i - 1].sample.odometry.t_us != permuted[i].sample.odometry.t_us) continue;
    std::swap(permuted[i - 1], permuted[i]);
    ++i;
  }
  Fusion a({}), b({});
  Odometry of_a, of_b;
  run(a, events, [&](const FusedPoses& f, const StreamEvent&) { of_a = f.local; });
  run(b, permuted, [&](const FusedPoses& f, const StreamEvent&) { of_b = f.local; });
  CHECK((of_a.T_frame_vehicle.p - of_b.T_frame_vehicle.p).norm() < 0.2);
}

TEST_CASE("a snapshot goes on with the same bits; shifted times change none") {
  const Tunnel t;
  const std::vector<StreamEvent> events = with(t.events(), t, {faults()[3]});
  Fusion whole({});
  std::vector<uint8_t> snapshot;
  std::vector<Eigen::Vector3d> places, locals;
  std::size_t at = 0;
  const std::size_t middle = events.size() * 6 / 10;
  run(whole, events, [&](const FusedPoses& f, const StreamEvent&) {
    places.push_back(f.fused.T_frame_vehicle.p);
    locals.push_back(f.local.T_frame_vehicle.p);
    if (++at != middle) return;
    StateWriter writer;
    whole.save(writer);
    snapshot = writer.take();
  });
  Fusion resumed({});
  StateReader reader(snapshot);
  resumed.load(reader);
  reader.finish();
  at = middle;
  run(resumed, {events.begin() + static_cast<std::ptrdiff_t>(middle), events.end()},
      [&](const FusedPoses& f, const StreamEvent&) {
        REQUIRE(f.fused.T_frame_vehicle.p == places[at]);
        REQUIRE(f.local.T_frame_vehicle.p == locals[at]);
        ++at;
      });
  std::vector<StreamEvent> shifted = events;
  for (StreamEvent& e : shifted) e.sample.odometry.t_us += 3'600'000'000;
  Fusion later({});
  at = 0;
  run(later, shifted,
      [&](const FusedPoses& f, const StreamEvent&) { REQUIRE(f.fused.T_frame_vehicle.p == places[at++]); });
}

TEST_CASE("broken samples are called by their name, and change nothing") {
  const Tunnel t;
  const std::vector<StreamEvent> events = t.events();
  Fusion a({}), b({});
  for (std::size_t i = 0; i < 3000; ++i) {
    (void)a.add(events[i].sample);
    (void)b.add(events[i].sample);
  }
  ChannelSample broken = events[3000].sample;
  broken.odometry.cov_pose(0, 0) = std::nan("");
  CHECK(b.add(broken) == FuseStatus::kBadInput);
  broken = events[3000].sample;
  broken.odometry.T_frame_vehicle.q.coeffs() *= 2.0;
  CHECK(b.add(broken) == FuseStatus::kBadInput);
  CHECK(a.publish({}).fused.T_frame_vehicle.p == b.publish({}).fused.T_frame_vehicle.p);
}

}  // namespace
}  // namespace roadfix
