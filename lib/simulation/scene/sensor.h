/// Makes a picture of light as a camera does: motion blur over the exposure, shot and read noise, a gamma, eight bits;
/// and chooses the next exposure from the last picture, one step at a time, so that a tunnel's mouth dazzles for a
/// second.
#pragma once

#include <cstdint>
#include <vector>

#include "simulation/scene/render.h"
#include "simulation/simulate.h"
#include "stream/executor.h"

namespace roadfix {

struct ExposureConfig {
  double shortest_s = 2e-5;
  double longest_s = 8e-3;
  double largest_gain = 8.0;   ///< beyond the longest exposure
  double target = 0.24;        ///< mean signal, full scale = 1
  double fastest_step = 1.35;  ///< factor from one picture to the next
  double start_s = 5e-4;
};

struct SensorConfig {
  ExposureConfig exposure;
  double full_scale_s = 8e-4;  ///< exposure by which light of radiance 1 gives full scale, gain 1
  double full_well_electrons = 8000.0;
  double read_noise_electrons = 12.0;
  bool root_response = true;  ///< grey value by the square root of the signal; otherwise by the signal
};

struct Exposure {
  double time_s = 5e-4;
  double gain = 1.0;
};

/// Eight bits a pixel, row by row.
struct GrayImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
};

/// The exposure after a picture taken with `last`.
Exposure next_exposure(const ExposureConfig& config, const SensorConfig& sensor, const Exposure& last,
                       const GrayImage& picture);

/// What makes one picture different from another of the same light.
struct Shot {
  std::uint64_t seed = 0;    ///< of the sensor's noise
  std::uint64_t number = 0;  ///< of the picture
  PictureEffects effects;
};

/// The same light, exposure and shot give the same bytes.
GrayImage expose(const SensorConfig& config, const LightField& light, const Exposure& exposure, const Shot& shot,
                 Executor& executor);

}  // namespace roadfix
