#include "camera/timestamp_filter.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

namespace roadfix {
namespace {

struct Run {
  double raw_rms_s = 0.0,
         rms_s = 0.0;  ///< RMS against the true times, constant offset removed, after the first 50 frames
  bool ascending = true;
};

/// A device at `rate_hz`, stamps late by up to `jitter_s`, every 40th frame skipped.
Run run(std::optional<double> told_hz, double rate_hz, double jitter_s, int frames = 600) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> late(0.0, jitter_s);
  TimestampFilter filter(told_hz);
  std::vector<double> raw, filtered;
  int64_t last = 0;
  Run result;
  for (int i = 0; i < frames; ++i) {
    if (i % 40 == 39) continue;
    const double true_s = i / rate_hz;
    const int64_t stamp = 1'700'000'000'000'000 + std::llround((true_s + late(random)) * 1e6);
    const int64_t t = filter.filter(stamp);
    result.ascending = result.ascending && t > last;
    last = t;
    if (i < 50) continue;
    raw.push_back(static_cast<double>(stamp - 1'700'000'000'000'000) * 1e-6 - true_s);
    filtered.push_back(static_cast<double>(t - 1'700'000'000'000'000) * 1e-6 - true_s);
  }
  const auto rms = [](const std::vector<double>& x) {
    double mean = 0.0, sum = 0.0;
    for (const double v : x) mean += v / static_cast<double>(x.size());
    for (const double v : x) sum += (v - mean) * (v - mean);
    return std::sqrt(sum / static_cast<double>(x.size()));
  };
  result.raw_rms_s = rms(raw);
  result.rms_s = rms(filtered);
  return result;
}

TEST_CASE("jitter is removed with the rate given, given wrong by 0.5 %, or not given") {
  for (const std::optional<double> told :
       {std::optional<double>(10.0), std::optional<double>(10.05), std::optional<double>()}) {
    const Run r = run(told, 10.0, 0.05);
    CHECK(r.ascending);
    CHECK(r.raw_rms_s > 0.012);  // teeth
    CHECK(r.rms_s < 0.25 * r.raw_rms_s);
  }
}

TEST_CASE("stamps without jitter are unchanged") {
  CHECK(run(10.0, 10.0, 0.0).rms_s < 1e-6);
  CHECK(run({}, 9.65, 0.0).rms_s < 1e-6);
}

TEST_CASE("the line restarts after a pause of a fractional number of periods") {
  TimestampFilter filter(10.0);
  int64_t t = 0, last = 0;
  for (int i = 0; i < 50; ++i) last = filter.filter(t += 100'000);
  t += 3'350'000;
  for (int i = 0; i < 50; ++i) {
    const int64_t now = filter.filter(t += 100'000);
    REQUIRE(now > last);
    last = now;
  }
  CHECK(std::abs(static_cast<double>(last - t)) < 60'000.0);
}

TEST_CASE("a restored filter continues with the same times") {
  TimestampFilter one(10.0), two(10.0);
  for (int i = 1; i < 20; ++i) (void)one.filter(100'000 * i + 7'000 * (i % 3));
  StateWriter writer;
  one.save(writer);
  const auto state = writer.take();
  StateReader reader(state);
  two.load(reader);
  reader.finish();
  for (int i = 20; i < 40; ++i) {
    REQUIRE(one.filter(100'000 * i + 7'000 * (i % 3)) == two.filter(100'000 * i + 7'000 * (i % 3)));
  }
}

}  // namespace
}  // namespace roadfix
