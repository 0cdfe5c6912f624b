// What the fused pose does and says in each fault, over the simulator's truth with made-up GNSS/INS, vision and wheels
// (test/unit/fusion/streams.h); one line a fault, medians over seeds. scripts/fusion-faults prints it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "simulation/scenarios.h"
#include "statistics/summary.h"
#include "unit/fusion/streams.h"

using namespace roadfix;
using test::StreamEvent;

namespace {

constexpr std::uint64_t kSeeds = 10;
constexpr double kSettle = 5.0;  // s after the fault

struct Trouble {
  const char* name;
  const char* said;  ///< words that the reason must have
  double from_s, to_s;
  bool tunnel = true;  ///< no GNSS from 40 to 100 s
  bool good_ins = true;
  std::function<bool(double, Planar&)> vision{};
  std::function<Eigen::Vector2d(double)> fixes{};
  std::optional<FusionChannel> dead{};
};

bool frozen(double t_s, Planar& motion) {
  if (t_s >= 60.0) motion.setZero();
  return true;
}
bool scaled(double t_s, Planar& motion) {
  if (t_s >= 60.0) motion.head<2>() *= 1.5;
  return true;
}
bool astray(double t_s, Planar& motion) {
  if (t_s >= 60.0) motion.y() += 0.3;
  return true;
}
Eigen::Vector2d dragged(double t_s) { return {std::clamp(0.3 * (t_s - 50.0), 0.0, 9.0), 0.0}; }
Eigen::Vector2d far_off(double t_s) { return {t_s > 100.0 && t_s < 106.0 ? 15.0 : 0.0, 0.0}; }

const std::vector<Trouble>& troubles() {
  static const std::vector<Trouble> kFaults = {
      {"none", "no GNSS", 40.0, 100.0},
      {"vo_scale_jump", "POSE_VO contradicts", 60.0, 100.0, true, true, scaled},
      {"vo_frozen", "POSE_VO contradicts", 60.0, 100.0, true, true, frozen},
      {"vo_confidently_wrong", "POSE_VO contradicts", 60.0, 100.0, true, true, astray},
      {"gnss_dragged_off", "POSE_INS contradicts", 50.0, 80.0, false, true, {}, dragged},
      {"gnss_15m_after_tunnel", "POSE_INS", 100.0, 106.0, true, true, {}, far_off},
      {"both_bad", "POSE_VO contradicts", 60.0, 106.0, true, true, astray, far_off},
      {"ins_killed", "POSE_INS is silent", 50.0, 70.0, false, true, {}, {}, FusionChannel::kIns},
      {"vo_killed", "no GNSS", 60.0, 100.0, true, true, {}, {}, FusionChannel::kVo},
  };
  return kFaults;
}

struct Outcome {
  double largest = 0.0, after = 0.0;   ///< m
  double within = 0.0, samples = 0.0;  ///< 3 sigma, horizontally, from the fault on
  std::optional<double> said_after;    ///< s
  int restarts = 0, resets = 0;
};

Outcome run_fault(const Trouble& fault, std::uint64_t seed) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 120.0;
  s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
  s.mag.rate_hz = 0.0;
  const SimulatedDrive drive = simulate(s, seed);
  test::InsNoise ins;
  if (fault.tunnel) ins.outages = {{40.0, 100.0}};
  if (fault.good_ins) ins.velocity_walk = 0.005;  // one with wheels
  ins.lie = fault.fixes;
  test::VoNoise vo, wheels;
  vo.fault = fault.vision;
  wheels.rate_hz = 20.0;
  auto events =
      test::merged({ins_stream(drive, ins, seed), test::vo_stream(drive, vo, seed), wheel_stream(drive, wheels, seed)});
  const auto seconds = [&](int64_t t_us) { return seconds_between(s.start_utime, t_us); };
  std::erase_if(events, [&](const StreamEvent& e) {
    const double t = seconds(e.sample.odometry.t_us);
    return fault.dead == e.sample.channel && t > fault.from_s && t < fault.to_s;
  });
  Fusion fusion({});
  Outcome o;
  run(fusion, events, [&](const FusedPoses& f, const StreamEvent& e) {
    const double t = seconds(e.sample.odometry.t_us);
    if (fusion.asks_restart()) {
      (void)fusion.take_restart(f.local);
      ++o.restarts;
    }
    if (t < fault.from_s) return;
    const test::PlanarError p = test::planar_error(drive, f.fused);
    if (t <= fault.to_s) o.largest = std::max(o.largest, p.distance());
    if (t > fault.to_s + kSettle) o.after = std::max(o.after, p.distance());
    o.within += p.distance() < 3.0 * std::sqrt(p.cov.topLeftCorner<2, 2>().trace()) ? 1.0 : 0.0;
    o.samples += 1.0;
    o.resets = f.report.reset_counter;
    if (!o.said_after && f.report.reason.find(fault.said) != std::string::npos) o.said_after = t - fault.from_s;
  });
  return o;
}

}  // namespace

int main() {
  std::printf("%-22s %9s %9s %8s %9s %6s %9s %7s\n", "fault", "largest_m", "after_m", "in_3s", "said_s", "silent",
              "restarts", "resets");
  for (const Trouble& fault : troubles()) {
    std::vector<double> largest, after, said;
    double within = 0.0, samples = 0.0, restarts = 0.0, resets = 0.0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const Outcome o = run_fault(fault, seed);
      largest.push_back(o.largest);
      after.push_back(o.after);
      if (o.said_after) said.push_back(*o.said_after);
      within += o.within;
      samples += o.samples;
      restarts += o.restarts;
      resets += o.resets;
    }
    std::printf("%-22s %9.3f %9.3f %7.1f%% %9.2f %6d %9.1f %7.1f\n", fault.name, median(largest), median(after),
                100.0 * within / samples, said.empty() ? std::nan("") : median(said),
                static_cast<int>(kSeeds - said.size()), restarts / kSeeds, resets / kSeeds);
  }
  return 0;
}
