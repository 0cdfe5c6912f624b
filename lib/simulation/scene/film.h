/// The cameras of a simulated drive at work: takes their pictures one exposure after the other.
///
/// Exposure control follows the left eye's pictures as they would be without faults, so that a fault changes the
/// pictures of its own time only. Same drive, same bytes, with any executor.
#pragma once

#include <array>
#include <optional>

#include "simulation/scene/drive_scene.h"
#include "simulation/scene/sensor.h"
#include "stream/executor.h"

namespace roadfix {

enum class CameraSide { kLeft, kRight };

class Film {
 public:
  /// The executor outlives the film. A drive whose layout is kNone is refused (std::invalid_argument).
  Film(const SimulatedDrive& drive, Executor& executor);

  /// Takes the next of drive.exposures; false where there is none.
  bool advance();

  /// When the next exposure is; no value at the drive's end.
  [[nodiscard]] std::optional<std::int64_t> next_us() const {
    return next_ < drive_.exposures.size() ? std::optional(drive_.exposures[next_]) : std::nullopt;
  }
  /// Takes no picture of it. Exposure control goes on from where it is.
  void skip() { ++next_; }

  // Of the newest exposure, after advance():
  [[nodiscard]] std::size_t taken() const { return next_ - 1; }
  [[nodiscard]] const Exposure& exposure() const { return exposure_; }
  [[nodiscard]] GrayImage picture(CameraSide eye, const PictureEffects& effects) const;
  /// Light, depth and flow: the truth beside the picture.
  [[nodiscard]] const LightField& light(CameraSide eye) const { return light_[static_cast<std::size_t>(eye)]; }

 private:
  [[nodiscard]] GrayImage develop(CameraSide eye, const PictureEffects& effects) const;

  const SimulatedDrive& drive_;
  Executor& executor_;
  SimulatedRig rig_;
  World world_;
  RayScene scene_;
  Renderer renderer_;
  SensorConfig sensor_;
  std::array<std::uint64_t, 2> noise_seed_;
  std::array<LightField, 2> light_;
  std::size_t next_ = 0;
  Exposure exposure_;
  GrayImage clean_left_;  // without faults: what the exposure control saw
};

}  // namespace roadfix
