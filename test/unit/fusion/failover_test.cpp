/// Channels that die, freeze, lie or jump on simulated drives: which pose is followed, what carries it, what is said.
#include "fusion/failover.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "channel_faults.h"

namespace roadfix {
namespace {

using test::Fault;
using test::faults;
using test::planar_error;
using test::run;
using test::StreamEvent;
using test::time_of;
using test::Tunnel;
using test::Watch;
using test::with;

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

TEST_CASE(
    "an INS that corrects itself by 30 m while no fix comes is not followed, with one it is, and it is announced") {
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

}  // namespace
}  // namespace roadfix
