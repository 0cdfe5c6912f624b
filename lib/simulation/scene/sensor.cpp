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
F8 bilinear(const LightField& light, F8 u, F8 v) {
  u = clamp(u, splat(0.0F), splat(static_cast<float>(light.width - 1)));
  v = clamp(v, splat(0.0F), splat(static_cast<float>(light.height - 1)));
  const F8 x = to_float(to_int(min(u, splat(static_cast<float>(light.width - 2)))));
  const F8 y = to_float(to_int(min(v, splat(static_cast<float>(light.height - 2)))));
  const F8 a = u - x;
  const F8 b = v - y;
  const float* const p = light.radiance.data();
  const float* const q = p + light.width;
  const I8 at = to_int(y) * light.width + to_int(x);
  return (1.0F - b) * ((1.0F - a) * look_up(p, at) + a * look_up(p + 1, at)) +
         b * ((1.0F - a) * look_up(q, at) + a * look_up(q + 1, at));
}

F8 load_some(const std::vector<float>& from, std::size_t at, int count) {
  if (count == kLanes) return load(&from[at]);
  F8 x = splat(0.0F);
  for (int i = 0; i < count; ++i) x[i] = from[at + static_cast<std::size_t>(i)];
  return x;
}

/// Mean light over the path that the surface takes through each of `count` pixels while the shutter is open, centred on
/// its middle.
F8 blurred(const LightField& light, int x, int y, int count, float exposure_s) {
  const auto at = static_cast<std::size_t>(y * light.width + x);
  const F8 sharp = load_some(light.radiance, at, count);
  F8 du = load_some(light.flow_u, at, count) * exposure_s;
  F8 dv = load_some(light.flow_v, at, count) * exposure_s;
  const F8 length = root(du * du + dv * dv);
  const I8 smeared = length >= kShortestBlur_px;
  if (!any(smeared)) return sharp;
  const F8 longest = splat(kLongestBlur_px);
  const F8 shrink = select(length > longest, longest / length, splat(1.0F));
  du *= shrink;
  dv *= shrink;
  const I8 taps = to_int(min(select(smeared, length, splat(0.0F)), longest)) + 2;
  const F8 u = to_float((I8)(static_cast<std::uint32_t>(x) + kLaneNumbers));
  const F8 v = splat(static_cast<float>(y));
  const F8 per_taps = to_float(taps);
  const auto most = static_cast<int>(largest(per_taps));
  F8 sum = splat(0.0F);
  for (int k = 0; k < most; ++k) {
    const F8 share = (static_cast<float>(k) + 0.5F) / per_taps - 0.5F;
    const F8 tap = bilinear(light, u + share * du, v + share * dv);
    sum += select(taps > k, tap, splat(0.0F));
  }
  return select(smeared, sum / per_taps, sharp);
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
    const F8 radiance = blurred(light, x, y, count, d.exposure_s);
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
