/// Motion of the tracks in the image since the last keyframe, beyond a rotation.
#pragma once

#include <span>
#include <vector>

#include "features/front_end.h"
#include "slam/local_map.h"

namespace roadfix {

/// One per track that the last keyframe has observed, px; `q_now_keyframe`: the rotation since.
std::vector<Eigen::Vector2d> track_shifts(const LocalMap& map, const Camera& camera,
                                          const Eigen::Quaterniond& q_now_keyframe, std::span<const Feature> features);

std::vector<double> lengths_of(std::span<const Eigen::Vector2d> shifts);

}  // namespace roadfix
