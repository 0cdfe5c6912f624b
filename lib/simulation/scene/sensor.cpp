#include "simulation/scene/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace roadfix {
namespace {

constexpr int kBandRows = 8;
constexpr float kLongestBlur_px = 48.0F;
constexpr float kShortestBlur_px = 0.1F;
constexpr int kQuantiles = 4096;

std::uint32_t mix_bits32(std::uint32_t h) {  // the finaliser of MurmurHash3 (Appleby, 2011)
  h ^= h >> 16;
  h *= 0x85EBCA6BU;
  h ^= h >> 13;
  h *= 0xC2B2AE35U;
  return h ^ (h >> 16);
}

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

GrayImage expose(const SensorConfig& config, const LightField& light, const Exposure& exposure, std::uint64_t seed,
                 std::uint64_t picture, const ParallelFor& parallel_for) {
  static const std::array<float, kQuantiles> kNormal = make_quantiles();
  GrayImage out{light.width, light.height, std::vector<std::uint8_t>(light.radiance.size())};
  const auto exposure_s = static_cast<float>(exposure.time_s);
  const auto electrons_per_light =
      static_cast<float>(exposure.time_s / config.full_scale_s * config.full_well_electrons);
  const auto per_electron = static_cast<float>(exposure.gain / config.full_well_electrons);
  const auto read_variance = static_cast<float>(config.read_noise_electrons * config.read_noise_electrons);
  const auto well = static_cast<float>(config.full_well_electrons);
  const std::uint32_t key = mix_bits32(static_cast<std::uint32_t>(seed) ^
                                       mix_bits32(static_cast<std::uint32_t>(seed >> 32) ^
                                                  mix_bits32(static_cast<std::uint32_t>(picture) +
                                                             0x9E3779B9U * static_cast<std::uint32_t>(picture >> 32))));
  const auto row = [&](int y) {
    for (int x = 0; x < light.width; ++x) {
      const auto at = static_cast<std::size_t>(y * light.width + x);
      const float electrons = blurred(light, x, y, exposure_s) * electrons_per_light;
      const std::uint32_t draw = mix_bits32(static_cast<std::uint32_t>(at) * 0x9E3779B1U + key) >> 20;
      const float noisy = electrons + std::sqrt(electrons + read_variance) * kNormal[draw];
      const float signal = std::clamp(std::min(noisy, well) * per_electron, 0.0F, 1.0F);
      out.pixels[at] = static_cast<std::uint8_t>(255.0F * (config.root_response ? std::sqrt(signal) : signal) + 0.5F);
    }
  };
  const int bands = (light.height + kBandRows - 1) / kBandRows;
  parallel_for(bands, [&](int band) {
    for (int y = band * kBandRows; y < std::min(light.height, (band + 1) * kBandRows); ++y) row(y);
  });
  return out;
}

}  // namespace roadfix
