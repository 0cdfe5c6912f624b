// Pictures of the simulated streets, 1241x376: a stereo pair through Film (light, noise, exposure), and its parts.
// Budget: a pair in 100 ms on two cores with its JPEG files (figure simulator.stereo_fps), so about 85 ms here.
// Run with taskset -c 0,1 on a quiet machine.
#include <benchmark/benchmark.h>

#include "simulation/scenarios.h"
#include "simulation/scene/film.h"
#include "simulation/scene/tracks.h"
#include "stream/thread_pool.h"

namespace roadfix {
namespace {

SimulatedDrive stereo_drive(const char* name, double rate_hz = 2.0) {
  ScenarioConfig config = scenario(name);
  config.camera.layout = CameraLayout::kStereo;
  config.camera.rate_hz = rate_hz;  // 2: more places in few pictures
  return simulate(config, 1);
}

void stereo_pair(benchmark::State& state, const char* name, int first) {
  const SimulatedDrive drive = stereo_drive(name);
  ThreadPool threads(static_cast<int>(state.range(0)));
  const SimulatedRig rig = rig_of(drive);
  const World world = world_of(drive);
  RayScene scene(world);
  const Renderer renderer(world, rig.camera);
  const SensorConfig sensor;
  std::array<LightField, 2> light;
  auto next = static_cast<std::size_t>(first);
  for ([[maybe_unused]] const auto _ : state) {
    const std::int64_t t_us = drive.exposures[next];
    next = next + 1 < static_cast<std::size_t>(first) + 40 ? next + 1 : static_cast<std::size_t>(first);
    renderer.render(scene, view_at(drive, rig.T_vehicle_left, t_us), threads, light[0]);
    renderer.render(scene, view_at(drive, rig.T_vehicle_right, t_us), threads, light[1]);
    for (const auto& l : light)
      benchmark::DoNotOptimize(expose(sensor, l, {5e-4, 1.0}, {1, next, {}}, threads).pixels.data());
  }
  state.counters["pairs_per_s"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK_CAPTURE(stereo_pair, street, "city_loop", 20)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(stereo_pair, highway, "highway", 40)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(stereo_pair, tunnel, "tunnel_lit", 220)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// The sensor alone, at a day's exposure and at a tunnel's, where everything is smeared over many pixels.
void develop(benchmark::State& state, double exposure_s) {
  const SimulatedDrive drive = stereo_drive("city_loop");
  const SimulatedRig rig = rig_of(drive);
  const World world = world_of(drive);
  RayScene scene(world);
  InlineExecutor executor;
  LightField light;
  Renderer(world, rig.camera).render(scene, view_at(drive, rig.T_vehicle_left, drive.exposures[40]), executor, light);
  for ([[maybe_unused]] const auto _ : state)
    benchmark::DoNotOptimize(expose({}, light, {exposure_s, 1.0}, {1, 1, {}}, executor).pixels.data());
}
BENCHMARK_CAPTURE(develop, day, 5e-4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(develop, tunnel, 8e-3)->Unit(benchmark::kMillisecond);

/// The same drive as points without pixels, both eyes: to hold against stereo_pair.
void tracks(benchmark::State& state) {
  const SimulatedDrive drive = stereo_drive("city_loop", 10.0);
  const SimulatedRig rig = rig_of(drive);
  const World world = world_of(drive);
  TrackSimulator simulator(world, {}, rig.camera,
                           TrackSimulator::RightCamera{rig.camera, rig.T_vehicle_left.inverse() * rig.T_vehicle_right},
                           1);
  std::size_t next = 0;
  for ([[maybe_unused]] const auto _ : state) {
    const std::int64_t t_us = drive.exposures[next++ % drive.exposures.size()];
    benchmark::DoNotOptimize(simulator.observe(view_at(drive, rig.T_vehicle_left, t_us)).data());
  }
}
BENCHMARK(tracks)->Unit(benchmark::kMillisecond);

void make_world(benchmark::State& state) {
  const SimulatedDrive drive = stereo_drive("city_loop");
  for ([[maybe_unused]] const auto _ : state) benchmark::DoNotOptimize(world_of(drive).faces.data());
}
BENCHMARK(make_world)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace roadfix
