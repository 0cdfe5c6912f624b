// What the sensor does to light: noise as configured, blur as long as the motion, exposure step by step.
#include <catch2/catch.hpp>

#include "simulation/scene/sensor.h"
#include "unit/simulation/scene/streets.h"

namespace roadfix {
namespace {

LightField flat(int width, int height, float radiance) {
  LightField l;
  l.width = width;
  l.height = height;
  const auto n = static_cast<std::size_t>(width * height);
  l.radiance.assign(n, radiance);
  l.flow_u.assign(n, 0.0F);
  l.flow_v.assign(n, 0.0F);
  return l;
}

struct Moments {
  double mean, variance;
};
Moments moments(const GrayImage& g) {
  double sum = 0.0;
  double squares = 0.0;
  for (const auto x : g.pixels) sum += x, squares += static_cast<double>(x) * x;
  const auto n = static_cast<double>(g.pixels.size());
  return {sum / n, squares / n - sum * sum / n / n};
}

/// Measured variance over that of shot and read noise (and of rounding), grey values, linear response.
double variance_ratio(const SensorConfig& truth, const SensorConfig& assumed, float radiance, double gain) {
  const Exposure exposure{truth.full_scale_s, gain};
  const Moments m = moments(expose(truth, flat(400, 300, radiance), exposure, {9, 4, {}}, test::inline_executor()));
  const double grey_per_electron = 255.0 * gain / assumed.full_well_electrons;
  const double electrons = radiance * assumed.full_well_electrons;
  const double read = assumed.read_noise_electrons;
  CHECK(m.mean == Approx(electrons * grey_per_electron).epsilon(0.01));
  return m.variance / (grey_per_electron * grey_per_electron * (electrons + read * read) + 1.0 / 12.0);
}

TEST_CASE("noise has the variance of shot and read noise at every level and gain") {
  SensorConfig config;
  config.root_response = false;
  for (const float radiance : {0.05F, 0.2F, 0.6F})
    CHECK(variance_ratio(config, config, radiance, 1.0) == Approx(1.0).epsilon(0.02));
  for (const float radiance : {0.03F, 0.08F})
    CHECK(variance_ratio(config, config, radiance, 6.0) == Approx(1.0).epsilon(0.02));
  SensorConfig louder = config;
  louder.read_noise_electrons *= 2.0;  // must show
  CHECK(variance_ratio(louder, config, 0.03F, 6.0) > 1.5);
}

TEST_CASE("noise differs from picture to picture and from seed to seed") {
  const LightField light = flat(64, 64, 0.3F);
  const SensorConfig config;
  const auto bytes = [&](std::uint64_t seed, std::uint64_t picture) {
    return expose(config, light, Exposure{}, {seed, picture, {}}, test::inline_executor()).pixels;
  };
  CHECK(bytes(1, 1) == bytes(1, 1));
  CHECK(bytes(1, 1) != bytes(1, 2));
  CHECK(bytes(1, 1) != bytes(2, 1));
}

TEST_CASE("an edge that moves is blurred over its way and stays centred") {
  LightField light = flat(200, 8, 0.1F);
  for (int y = 0; y < 8; ++y) {
    for (int x = 100; x < 200; ++x) light.radiance[static_cast<std::size_t>(y * 200 + x)] = 0.5F;
  }
  light.flow_u.assign(light.flow_u.size(), 5000.0F);
  SensorConfig config;
  config.root_response = false;
  config.read_noise_electrons = 0.0;
  config.full_well_electrons = 1e9;  // no noise to speak of
  const auto row = [&](double exposure_s) {
    config.full_scale_s = exposure_s;
    const auto g = expose(config, light, Exposure{exposure_s, 1.0}, {1, 1, {}}, test::inline_executor());
    return std::vector<int>(g.pixels.begin() + 4 * 200, g.pixels.begin() + 5 * 200);
  };
  const auto width = [](const std::vector<int>& r) {
    return std::count_if(r.begin(), r.end(), [](int g) { return g > 30 && g < 123; });
  };
  CHECK(width(row(1e-5)) == 0);
  const auto blurred = row(4e-3);  // 20 px
  CHECK(width(blurred) >= 18);
  CHECK(width(blurred) <= 21);
  // Between the last dark and the first bright pixel centre: 99.5.
  CHECK(0.5 * (blurred[99] + blurred[100]) == Approx(0.5 * (25.5 + 127.5)).margin(2.0));
}

TEST_CASE("exposure goes to its target in bounded steps and stops at its limits") {
  const SensorConfig config;
  const auto run = [&](float radiance, Exposure e) {
    int steps = 0;
    for (; steps < 100; ++steps) {
      const Exposure next = next_exposure(
          config.exposure, config, e, expose(config, flat(32, 32, radiance), e, {1, 1, {}}, test::inline_executor()));
      const double ratio = next.time_s * next.gain / (e.time_s * e.gain);
      CHECK(ratio <= config.exposure.fastest_step * 1.0001);
      CHECK(ratio >= 0.9999 / config.exposure.fastest_step);
      e = next;
      if (std::abs(ratio - 1.0) < 0.02) break;
    }
    return std::pair(steps, e);
  };
  const auto [steps, day] = run(0.4F, Exposure{});
  CHECK(steps < 10);
  CHECK(moments(expose(config, flat(32, 32, 0.4F), day, {1, 1, {}}, test::inline_executor())).mean ==
        Approx(255.0 * std::sqrt(config.exposure.target)).epsilon(0.05));
  const auto [dark_steps, tunnel] = run(0.01F, day);
  CHECK(dark_steps > 8);  // the mouth of a tunnel is dark for about a second
  CHECK(tunnel.time_s * tunnel.gain > 20.0 * day.time_s);
  const auto [night_steps, night] = run(1e-5F, tunnel);
  CHECK(night_steps > 0);
  CHECK(night.time_s == config.exposure.longest_s);
  CHECK(night.gain == config.exposure.largest_gain);
}

}  // namespace
}  // namespace roadfix
