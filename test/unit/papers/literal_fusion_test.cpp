/// Lee et al. (2025) as printed, on simulated drives: each switch does something, the gate recovers, and the covariance is too
/// small for poses that are not independent.
#include "papers/literal_fusion.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "statistics/consistency.h"
#include "unit/fusion/tunnel.h"

namespace roadfix {
namespace {

using test::planar_error;
using test::StreamEvent;
using test::Tunnel;

struct Outcome {
  double largest_in = 0.0, largest_after = 0.0;  ///< m, in the outage and from 5 s after it on
  double nees = 0.0;
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  double sum = 0.0;  ///< of all coordinates
  int resets = 0;
};

Outcome outcome(const LiteralConfig& config, const Tunnel& t) {
  LiteralFusion fusion(config, MotionNoise{}, ModeDurations{});
  Outcome o;
  ConsistencyAccumulator nees;
  for (const StreamEvent& e : t.events()) {
    if (e.sample.channel == FusionChannel::kIns) fusion.set_gnss(e.sample.odometry.t_us, e.gnss);
    (void)fusion.add(e.sample);
    const double s = test::seconds(t.drive, e.sample.odometry.t_us);
    if (s < 2.0 || e.sample.channel != FusionChannel::kIns) continue;
    const test::PlanarError p = planar_error(t.drive, fusion.fused());
    o.sum += p.error.x() + p.error.y();
    if (s > 40.0 && s < 100.0) o.largest_in = std::max(o.largest_in, p.distance());
    if (s > 105.0) o.largest_after = std::max(o.largest_after, p.distance());
    if (e.sample.odometry.t_us % 10'000'000 == 0) nees.add(p.nees(), 3);
  }
  o.nees = nees.ratio();
  o.last = fusion.fused().T_frame_vehicle.p;
  o.resets = fusion.resets();
  return o;
}

TEST_CASE("the scheme goes through a tunnel and comes back, and claims too much") {
  const Outcome o = outcome({}, Tunnel());
  CHECK(o.largest_in < 15.0);
  CHECK(o.largest_after < 1.0);
  CHECK(o.nees > 3.0);
}

TEST_CASE("each switch of the ablation changes the result") {
  const Tunnel t;
  LiteralConfig base;
  base.adaptive.min_position = 0.1;  // so that there is something to clip
  const Outcome printed = outcome(base, t);
  const auto differs = [&](const auto& change) {
    LiteralConfig config = base;
    change(config);
    return std::abs(outcome(config, t).sum - printed.sum) > 1e-6;
  };
  CHECK(!differs([](LiteralConfig&) {}));
  CHECK(differs([](LiteralConfig& c) { c.scale = false; }));
  CHECK(differs([](LiteralConfig& c) { c.clip = false; }));
  CHECK(differs([](LiteralConfig& c) { c.ramp = false; }));
  CHECK(differs([](LiteralConfig& c) { c.gnss_first = false; }));
  CHECK(differs([](LiteralConfig& c) { c.fixed_noise = true; }));
  CHECK(differs([](LiteralConfig& c) { c.one_model = true; }));
}

TEST_CASE("the gate recovers after it has refused for long, without that it never does") {
  Tunnel t;
  t.ins.outages.clear();
  t.vo.fault = [](double t_s, Planar& motion) {
    if (t_s > 50.0 && t_s < 51.0) motion.x() += 5.0;  // 50 m in a second, for good
    return true;
  };
  // The INS is right all along; from 60 s on it is 80 m elsewhere, and stays there.
  t.ins.lie = [](double t_s) { return Eigen::Vector2d(t_s > 60.0 ? 80.0 : 0.0, 0.0); };
  LiteralConfig config;
  const Outcome recovers = outcome(config, t);
  CHECK(recovers.resets > 0);
  LiteralConfig never = config;
  never.gate_recovers = 100000;
  const Outcome stuck = outcome(never, t);
  CHECK(stuck.resets == 0);
  CHECK((recovers.last - stuck.last).norm() > 10.0);
}

TEST_CASE("a snapshot of the literal scheme goes on with the same bits") {
  for (const bool gnss_first : {true, false}) {
    const Tunnel t;
    const auto events = t.events();
    LiteralConfig config;
    config.gnss_first = gnss_first;
    LiteralFusion whole(config, {}, {}), resumed(config, {}, {});
    for (std::size_t i = 0; i < events.size(); ++i) {
      if (i == 3001) {
        StateWriter writer;
        whole.save(writer);
        const std::vector<uint8_t> bytes = writer.take();
        StateReader reader(bytes);
        resumed.load(reader);
        reader.finish();
      }
      (void)whole.add(events[i].sample);
      if (i > 3000) (void)resumed.add(events[i].sample);
    }
    CHECK(whole.fused().T_frame_vehicle.p == resumed.fused().T_frame_vehicle.p);
  }
}

}  // namespace
}  // namespace roadfix
