// What the GNSS/INS filter costs on the demo drive: process-wide CPU per IMU sample (100 Hz) with GNSS (4 Hz), wheel
// (20 Hz) and magnetometer updates, the horizon's lag and an output for now included. Budget: 10 us
// (gnss_ins.cost_us).
#include <benchmark/benchmark.h>

#include <roadfix/gnss_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/log/log_reader.h"
#include "bus/sample_codec.h"
#include "bus/types/message.h"
#include "config/calibration.h"
#include "gnss_ins_ekf/messages.h"
#include "gnss_ins_ekf/vehicle_facts.h"
#include "navigation/navigation.h"

using namespace roadfix;

namespace {

constexpr int64_t kLateness_us = 250'000;  // of GNSS: how far the horizon stays behind

struct Drive {
  navigation::NavigationConfig config;
  std::vector<ImuSample> imu;
  std::vector<GnssFix> gnss;
  std::vector<WheelSample> wheels;
  std::vector<MagSample> mag;
};

Drive demo_drive() {
  const std::filesystem::path root = ROADFIX_SOURCE_DIR;
  Drive drive;
  drive.config.facts = vehicle_facts(load_calibration(root / "configs/demo"));
  LogReader reader(root / "logs/demo.lcm");
  while (const auto event = reader.next()) {
    if (event->channel == "IMU") drive.imu.push_back(imu_sample(decode<imu_t>(event->data)));
    if (event->channel == "GNSS") drive.gnss.push_back(gnss_fix(decode<gnss_t>(event->data)));
    if (event->channel == "WHEELS") drive.wheels.push_back(wheel_sample(decode<wheels_t>(event->data)));
    if (event->channel == "MAG") drive.mag.push_back(mag_sample(decode<mag_t>(event->data)));
  }
  return drive;
}

/// Hands in every sample that the horizon has passed, as the stage does.
template <class Sample>
void add_until(navigation::Navigation& filter, const std::vector<Sample>& samples, std::size_t& next,
               int64_t horizon_us) {
  for (; next < samples.size() && samples[next].t_us <= horizon_us; ++next) filter.add(samples[next]);
}

void run(navigation::Navigation& filter, const Drive& drive) {
  std::size_t advanced = 0;
  std::size_t gnss = 0;
  std::size_t wheels = 0;
  std::size_t mag = 0;
  for (const ImuSample& newest : drive.imu) {
    benchmark::DoNotOptimize(filter.see(newest));
    for (; drive.imu[advanced].t_us <= newest.t_us - kLateness_us; ++advanced) {
      add_until(filter, drive.gnss, gnss, drive.imu[advanced].t_us - 1);
      add_until(filter, drive.wheels, wheels, drive.imu[advanced].t_us - 1);
      add_until(filter, drive.mag, mag, drive.imu[advanced].t_us - 1);
      benchmark::DoNotOptimize(filter.advance(drive.imu[advanced]));
    }
    benchmark::DoNotOptimize(filter.output());
    filter.clear_records();
  }
}

void BM_GnssInsDrive(benchmark::State& state) {
  const Drive drive = demo_drive();
  int64_t samples = 0;
  for ([[maybe_unused]] const auto _ : state) {
    navigation::Navigation filter(drive.config);
    run(filter, drive);
    samples += static_cast<int64_t>(drive.imu.size());
    if (filter.status().phase != navigation::Phase::kDone) state.SkipWithError("the filter did not align");
  }
  // In seconds; the console shows it with a unit prefix, the JSON as it is.
  state.counters["cpu_per_imu_sample_s"] =
      benchmark::Counter(static_cast<double>(samples), benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_GnssInsDrive)->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);

}  // namespace
