#include "slam/track_shifts.h"

namespace roadfix {

std::vector<Eigen::Vector2d> track_shifts(const LocalMap& map, const Camera& camera,
                                          const Eigen::Quaterniond& q_now_keyframe, std::span<const Feature> features) {
  std::vector<Eigen::Vector2d> shifts;
  for (const Feature& f : features) {
    const Landmark* landmark = map.find(f.track);
    if (landmark == nullptr || landmark->observations.empty()) continue;
    const LandmarkObservation& seen = landmark->observations.back();
    const auto now = camera.unproject(f.pixel.cast<double>());
    if (seen.keyframe != map.last().id || !now) continue;
    const Eigen::Vector3d turned = q_now_keyframe * seen.left.homogeneous();
    shifts.emplace_back(camera.focal() * (*now - turned.hnormalized()));
  }
  return shifts;
}

std::vector<double> lengths_of(std::span<const Eigen::Vector2d> shifts) {
  std::vector<double> lengths;
  for (const Eigen::Vector2d& shift : shifts) lengths.push_back(shift.norm());
  return lengths;
}

}  // namespace roadfix
