/// What is published for now with one channel alone, and with each fault and pair of faults: nothing invalid as valid.
#include <catch2/catch.hpp>
#include <cmath>

#include "channel_faults.h"

namespace roadfix {
namespace {

using test::faults;
using test::StreamEvent;
using test::time_of;
using test::Tunnel;

constexpr int64_t kHorizon_us = 50'000;
constexpr int64_t kTimeout_us = 300'000;  // after which the wheels are the clock

/// As imm_fusion runs it: the clock's newest sample at once, everything when it is 50 ms old. Called at each tick.
void run_for_now(Fusion& fusion, const std::vector<StreamEvent>& events, const test::OnFused& on_fused) {
  NewestSample newest;
  std::size_t next = 0;
  int64_t ins_us = 0, now_us = 0;
  for (const StreamEvent& e : events) {
    const int64_t t_us = e.sample.odometry.t_us;
    const bool ins = e.sample.channel == FusionChannel::kIns;
    if (ins) ins_us = t_us;
    const bool wheels = e.sample.channel == FusionChannel::kWheel && t_us - ins_us > kTimeout_us;
    if ((!ins && !wheels) || t_us <= now_us) continue;
    now_us = t_us;
    newest.see(e.sample);
    for (; next < events.size() && events[next].sample.odometry.t_us <= now_us - kHorizon_us; ++next) {
      const StreamEvent& old = events[next];
      if (old.sample.channel == FusionChannel::kIns) fusion.set_gnss(old.sample.odometry.t_us, old.gnss);
      (void)fusion.add(old.sample);
    }
    on_fused(fusion.publish(newest), e);
  }
}

bool is_pose(const Odometry& o) { return o.validity != Validity::kInvalid && usable(o); }

TEST_CASE(
    "whatever fails, alone or in pairs, what is published as valid is a valid pose of the INS, and never not a "
    "number") {
  const auto& all = faults();
  std::vector<std::vector<test::Fault>> cases;
  for (std::size_t i = 0; i < all.size(); ++i) {
    cases.push_back({all[i]});
    for (std::size_t j = i + 1; j < all.size(); ++j)
      if (all[i].channel != all[j].channel) cases.push_back({all[i], all[j]});
  }
  Tunnel t;
  t.ins.outages.clear();
  const std::vector<StreamEvent> events = t.events();
  for (const std::vector<test::Fault>& fault : cases) {
    Fusion fusion({});
    int valid = 0, wrong = 0, no_number = 0;
    run_for_now(fusion, test::with(events, t, fault), [&](const FusedPoses& f, const StreamEvent& e) {
      if (f.fused.validity != Validity::kInvalid && !usable(f.fused)) ++no_number;
      if (f.local.validity != Validity::kInvalid && !usable(f.local)) ++no_number;
      if (f.fused.validity != Validity::kValid) return;
      ++valid;
      const Odometry& ins = e.sample.odometry;
      const bool followed = e.sample.channel == FusionChannel::kIns && is_pose(ins) && f.fused.t_us == ins.t_us &&
                            f.fused.T_frame_vehicle.p == ins.T_frame_vehicle.p;
      if (!followed) ++wrong;
    });
    CAPTURE(fault.front().name, fault.back().name);
    CHECK(valid > 3000);
    CHECK(wrong == 0);
    CHECK(no_number == 0);
  }
}

TEST_CASE("each channel alone: the INS is followed, a witness gives a usable pose in a local frame that says so") {
  for (const FusionChannel c : {FusionChannel::kIns, FusionChannel::kVo, FusionChannel::kWheel}) {
    Tunnel t;
    t.ins.outages.clear();
    std::vector<StreamEvent> events = t.events();
    std::erase_if(events, [&](const StreamEvent& e) { return e.sample.channel != c; });
    Fusion fusion({});
    FusedPoses first, last;
    bool started = false;
    test::run(fusion, events, [&](const FusedPoses& f, const StreamEvent& e) {
      if (time_of(t, e) < 5.0) return;
      if (!started) first = f;
      started = true;
      last = f;
      const bool ins = c == FusionChannel::kIns;
      REQUIRE(f.fused.validity == (ins ? Validity::kValid : Validity::kCoasting));
      REQUIRE(f.report.enu == ins);
      REQUIRE(f.report.reason.empty() == ins);
    });
    const auto motion = [&](const Odometry& a, const Odometry& b) {
      return motion_between(planar_pose(a), planar_pose(b));
    };
    const Planar driven = motion(t.drive.truth_at(first.fused.t_us), t.drive.truth_at(last.fused.t_us));
    const Planar told = motion(first.fused, last.fused), local = motion(first.local, last.local);
    CAPTURE(static_cast<int>(c), (told - driven).head<2>().norm(), driven.head<2>().norm());
    CHECK((told - driven).head<2>().norm() < 25.0);  // a scale of 1 %, turns of 0.3 %, over more than a kilometre
    CHECK((local - driven).head<2>().norm() < 25.0);
    CHECK(fusion.local_motion().leader() == c);
  }
}

}  // namespace
}  // namespace roadfix
