#include "simulation/scene/film.h"

#include <stdexcept>

#include "simulation/sensors.h"

namespace roadfix {
namespace {

const SimulatedDrive& with_camera(const SimulatedDrive& drive) {
  if (drive.config.camera.layout == CameraLayout::kNone)
    throw std::invalid_argument("simulation: " + drive.config.name + " has no camera to take pictures with");
  return drive;
}

std::uint64_t noise_seed(const SimulatedDrive& drive, CameraSide eye) {
  return stream_of(drive, NoiseStream::kPicture, static_cast<std::uint64_t>(eye)).bits();
}

}  // namespace

Film::Film(const SimulatedDrive& drive, Executor& executor)
    : drive_(with_camera(drive)),
      executor_(executor),
      rig_(rig_of(drive)),
      world_(world_of(drive)),
      scene_(world_),
      renderer_(world_, rig_.camera),
      noise_seed_{noise_seed(drive, CameraSide::kLeft), noise_seed(drive, CameraSide::kRight)} {
  exposure_.time_s = sensor_.exposure.start_s;
}

bool Film::advance() {
  if (next_ == drive_.exposures.size()) return false;
  const bool first = clean_left_.pixels.empty();
  const std::int64_t t_us = drive_.exposures[next_++];
  renderer_.render(scene_, view_at(drive_, rig_.T_vehicle_left, t_us), executor_, light_[0]);
  if (drive_.config.camera.layout == CameraLayout::kStereo)
    renderer_.render(scene_, view_at(drive_, rig_.T_vehicle_right, t_us), executor_, light_[1]);
  if (!first) exposure_ = next_exposure(sensor_.exposure, sensor_, exposure_, clean_left_);
  clean_left_ = develop(CameraSide::kLeft, {});
  return true;
}

GrayImage Film::picture(CameraSide eye, const PictureEffects& effects) const {
  const bool clean = effects.light_factor == 1.0 && effects.glare == 0.0 && effects.noise_factor == 1.0 &&
                     effects.occluded_share == 0.0;  // a damaged file is the encoder's
  return eye == CameraSide::kLeft && clean ? clean_left_ : develop(eye, effects);
}

GrayImage Film::develop(CameraSide eye, const PictureEffects& effects) const {
  const auto k = static_cast<std::size_t>(eye);
  PictureEffects all = effects;
  all.noise_factor *= drive_.config.camera.noise_factor;
  return expose(sensor_, light_[k], exposure_, {noise_seed_[k], taken(), all}, executor_);
}

}  // namespace roadfix
