#include "simulation/scene/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "simulation/scene/lanes.h"

namespace roadfix {
namespace {

constexpr int kBandRows = 8;
constexpr float kLongestBlur_px = 48.0F;
constexpr float kShortestBlur_px = 0.1F;
constexpr int kQuantiles = 4096;
constexpr float kOccluder = 0.1F;       // radiance of dirt on the lens
constexpr float kOccluderEdge = 0.03F;  // share of the width over which it fades

constexpr U8 kLaneNumbers = {0, 1, 2, 3, 4, 5, 6, 7};

std::uint32_t mix_bits32(std::uint32_t h) { return mix_bits(splat(h))[0]; }

/// Midpoint quantiles of the normal distribution, by bisection of erfc: a draw is one look-up. Their variance is 0.999.
std::array<float, kQuantiles> make_quantiles() {
  std::array<float, kQuantiles> q{};
  for (int i = 0; i < kQuantiles / 2; ++i) {
    const double p = (i + 0.5) / kQuantiles;
    double lo = -6.0;
    double hi = 0.0;
    for (int k = 0; k < 40; ++k) {
      const double x = 0.5 * (lo + hi);
      (0.5 * std::erfc(-x * std::sqrt(0.5)) < p ? lo : hi) = x;
    }
    q[static_cast<std::size_t>(i)] = static_cast<float>(lo);
    q[static_cast<std::size_t>(kQuantiles - 1 - i)] = static_cast<float>(-lo);
  }
  return q;
}

/// Light at fractional coordinates, the picture's edge continued.
float bilinear(const LightField& light, float u, float v) {
  u = std::clamp(u, 0.0F, static_cast<float>(light.width - 1));
  v = std::clamp(v, 0.0F, static_cast<float>(light.height - 1));
  const int x = std::min(static_cast<int>(u), light.width - 2);
  const int y = std::min(static_cast<int>(v), light.height - 2);
  const float a = u - static_cast<float>(x);
  const float b = v - static_cast<float>(y);
  const float* p = &light.radiance[static_cast<std::size_t>(y * light.width + x)];
  const float* q = p + light.width;
  return (1.0F - b) * ((1.0F - a) * p[0] + a * p[1]) + b * ((1.0F - a) * q[0] + a * q[1]);
}

/// Mean light over the way that the surface takes through the pixel while the shutter is open, centred on its middle.
float blurred(const LightField& light, int x, int y, float exposure_s) {
  const auto at = static_cast<std::size_t>(y * light.width + x);
  float du = light.flow_u[at] * exposure_s;
  float dv = light.flow_v[at] * exposure_s;
  const float length = std::sqrt(du * du + dv * dv);
  if (length < kShortestBlur_px) return light.radiance[at];
  if (length > kLongestBlur_px) {
    du *= kLongestBlur_px / length;
    dv *= kLongestBlur_px / length;
  }
  const int taps = 2 + static_cast<int>(std::min(length, kLongestBlur_px));
  float sum = 0.0F;
  for (int k = 0; k < taps; ++k) {
    const float share = (static_cast<float>(k) + 0.5F) / static_cast<float>(taps) - 0.5F;
    sum += bilinear(light, static_cast<float>(x) + share * du, static_cast<float>(y) + share * dv);
  }
  return sum / static_cast<float>(taps);
}

}  // namespace

Exposure next_exposure(const ExposureConfig& config, const SensorConfig& sensor, const Exposure& last,
                       const GrayImage& picture) {
  std::int64_t sum = 0;  // of the signal, 65025 = full scale
  for (const std::uint8_t g : picture.pixels) sum += sensor.root_response ? g * g : 255 * g;
  const double mean = static_cast<double>(sum) / (65025.0 * static_cast<double>(picture.pixels.size()));
  const double step = std::clamp(config.target / std::max(mean, 1e-6), 1.0 / config.fastest_step, config.fastest_step);
  const double wanted = last.time_s * last.gain * step;
  Exposure next;
  next.time_s = std::clamp(wanted, config.shortest_s, config.longest_s);
  next.gain = std::clamp(wanted / next.time_s, 1.0, config.largest_gain);
  return next;
}

namespace {

/// The arithmetic of one picture, the same for all of its pixels.
struct Development {
  float exposure_s;
  float electrons_per_light;
  float glare;  // electrons
  float read_variance;
  float noise_factor;
  float well;
  float per_electron;
  float occluded_to;  // px; what hides the scene ends here, over kOccluderEdge of the width
  float occluder_edge;
  std::uint32_t key;
  bool root_response;
};

Development development(const SensorConfig& config, int width, const Exposure& exposure, const Shot& shot) {
  const PictureEffects& e = shot.effects;
  Development d{};
  d.exposure_s = static_cast<float>(exposure.time_s);
  d.electrons_per_light =
      static_cast<float>(e.light_factor * exposure.time_s / config.full_scale_s * config.full_well_electrons);
  d.glare = static_cast<float>(e.glare * config.full_well_electrons / exposure.gain);
  d.read_variance = static_cast<float>(config.read_noise_electrons * config.read_noise_electrons);
  d.noise_factor = static_cast<float>(e.noise_factor);
  d.well = static_cast<float>(config.full_well_electrons);
  d.per_electron = static_cast<float>(exposure.gain / config.full_well_electrons);
  d.occluder_edge = kOccluderEdge * static_cast<float>(width);
  d.occluded_to = static_cast<float>(e.occluded_share * width);
  const auto half = [](std::uint64_t x, int k) { return static_cast<std::uint32_t>(x >> (32 * k)); };
  d.key = mix_bits32(
      half(shot.seed, 0) ^
      mix_bits32(half(shot.seed, 1) ^ mix_bits32(half(shot.number, 0) + 0x9E3779B9U * half(shot.number, 1))));
  d.root_response = config.root_response;
  return d;
}

/// Grey values of eight pixels from the light that falls on them; `at` is the first one's number.
I8 grey_values(const Development& d, F8 radiance, F8 column, std::uint32_t at) {
  static const std::array<float, kQuantiles> kNormal = make_quantiles();
  if (d.occluded_to > 0.0F) {
    const F8 seen = clamp01((column - d.occluded_to) / d.occluder_edge + 1.0F);
    radiance = select(seen < 1.0F, kOccluder + (radiance - kOccluder) * seen, radiance);
  }
  const F8 electrons = radiance * d.electrons_per_light + d.glare;
  const U8 draw = mix_bits((at + kLaneNumbers) * 0x9E3779B1U + d.key) >> 20;
  F8 noise;
  for (int i = 0; i < kLanes; ++i) noise[i] = kNormal[draw[i]];
  const F8 noisy = electrons + d.noise_factor * root(electrons + d.read_variance) * noise;
  const F8 signal = clamp01(min(noisy, splat(d.well)) * d.per_electron);
  return to_int(255.0F * (d.root_response ? root(signal) : signal) + 0.5F);
}

void develop_row(const Development& d, const LightField& light, int y, std::uint8_t* out) {
  for (int x = 0; x < light.width; x += kLanes) {
    const int count = std::min(kLanes, light.width - x);
    F8 radiance = splat(0.0F);
    for (int i = 0; i < count; ++i) radiance[i] = blurred(light, x + i, y, d.exposure_s);
    const auto at = static_cast<std::uint32_t>(y * light.width + x);
    const I8 grey = grey_values(d, radiance, to_float((I8)(static_cast<std::uint32_t>(x) + kLaneNumbers)), at);
    for (int i = 0; i < count; ++i) out[x + i] = static_cast<std::uint8_t>(grey[i]);
  }
}

}  // namespace

GrayImage expose(const SensorConfig& config, const LightField& light, const Exposure& exposure, const Shot& shot,
                 Executor& executor) {
  GrayImage out{light.width, light.height, std::vector<std::uint8_t>(light.radiance.size())};
  const Development d = development(config, light.width, exposure, shot);
  const int bands = (light.height + kBandRows - 1) / kBandRows;
  executor.for_each(bands, [&](int band) {
    for (int y = band * kBandRows; y < std::min(light.height, (band + 1) * kBandRows); ++y)
      develop_row(d, light, y, &out.pixels[static_cast<std::size_t>(y * light.width)]);
  });
  return out;
}

}  // namespace roadfix
