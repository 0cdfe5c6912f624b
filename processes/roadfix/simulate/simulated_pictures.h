/// The pictures of a simulated drive as files, made in the order in which they were taken and kept until they are
/// written: the log lies in order of arrival.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <roadfix/image_t.hpp>

#include "simulation/scene/film.h"

namespace roadfix {

class SimulatedPictures {
 public:
  /// `progress` is given the number of exposures taken so far. All outlive this.
  SimulatedPictures(const SimulatedDrive& drive, Executor& executor, std::function<void(std::size_t)> progress);

  /// The message of drive.pictures_left[index] or pictures_right[index], without run and seq; each is given once.
  image_t take(CameraSide eye, std::size_t index);

 private:
  void advance();
  [[nodiscard]] const std::vector<Picture>& pictures(CameraSide eye) const;

  const SimulatedDrive& drive_;
  Executor& executor_;
  std::function<void(std::size_t)> progress_;
  Film film_;
  std::array<std::map<std::size_t, image_t>, 2> ready_;  ///< by index
  std::array<std::size_t, 2> next_{};                    ///< index of the first that is not encoded yet
};

/// JPEG or PNG, damaged where the effects say so.
std::vector<std::uint8_t> picture_file(const GrayImage& picture, const CameraConfig& config,
                                       const PictureEffects& effects);

}  // namespace roadfix
