// What the fusion costs on a simulated drive with an outage: process-wide CPU per step (one sample of POSE_INS at
// 100 Hz, POSE_VO at 10 Hz or POSE_WHEEL at 50 Hz handed in), budget 3 us (fusion.step_us); and per output for now,
// 0.05 s ahead of the horizon.
#include <benchmark/benchmark.h>

#include "fusion/fusion.h"
#include "simulation/scenarios.h"
#include "unit/fusion/streams.h"

using namespace roadfix;

namespace {

constexpr double kDuration = 100.0;    // s
constexpr int64_t kLateness = 50'000;  // us: how far the horizon stays behind

SimulatedDrive drive() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = kDuration;
  s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
  s.mag.rate_hz = 0.0;
  return simulate(s, 1);
}

std::vector<test::StreamEvent> events(const SimulatedDrive& d) {
  test::InsNoise ins;
  ins.rate_hz = 100.0;
  ins.fix_period = 0.25;
  ins.outages = {{40.0, 80.0}};
  test::VoNoise wheels;
  wheels.rate_hz = 50.0;
  return test::merged({ins_stream(d, ins, 1), test::vo_stream(d, {}, 1), wheel_stream(d, wheels, 1)});
}

benchmark::Counter per(int64_t count) {
  // In seconds; the console shows it with a unit prefix, the JSON as it is.
  return {static_cast<double>(count), benchmark::Counter::kIsRate | benchmark::Counter::kInvert};
}

void BM_FusionDrive(benchmark::State& state) {
  const SimulatedDrive d = drive();
  const std::vector<test::StreamEvent> all = events(d);
  int64_t steps = 0;
  for ([[maybe_unused]] const auto _ : state) {
    Fusion fusion({});
    for (const test::StreamEvent& e : all) {
      if (e.sample.channel == FusionChannel::kIns) fusion.set_gnss(e.sample.odometry.t_us, e.gnss);
      (void)fusion.add(e.sample);
      ++steps;
    }
    if (fusion.publish({}).report.validity != Validity::kValid) state.SkipWithError("the fusion has no valid pose");
  }
  state.counters["cpu_per_step_s"] = per(steps);
}
BENCHMARK(BM_FusionDrive)->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);

void BM_FusionOutput(benchmark::State& state) {
  const SimulatedDrive d = drive();
  const std::vector<test::StreamEvent> all = events(d);
  Fusion fusion({});
  NewestSample newest;
  const int64_t horizon_us = d.config.start_utime + 60'000'000;
  for (const test::StreamEvent& e : all) {
    const int64_t t_us = e.sample.odometry.t_us;
    if (t_us <= horizon_us) (void)fusion.add(e.sample);
    if (e.sample.channel == FusionChannel::kIns && t_us <= horizon_us + kLateness) newest.see(e.sample);
  }
  for ([[maybe_unused]] const auto _ : state) benchmark::DoNotOptimize(fusion.publish(newest));
  state.counters["cpu_per_output_s"] = per(static_cast<int64_t>(state.iterations()));
}
BENCHMARK(BM_FusionOutput)->MeasureProcessCPUTime();

}  // namespace
