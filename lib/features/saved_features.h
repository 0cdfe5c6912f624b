/// What front ends have in common in a saved state: features and pictures.
#pragma once

#include "features/front_end.h"

namespace roadfix {

void save_features(std::span<const Feature> features, StateWriter& writer);
std::vector<Feature> load_features(StateReader& reader);

/// 8-bit grey; an empty picture is one too.
void save_picture(const cv::Mat& gray, StateWriter& writer);
cv::Mat load_picture(StateReader& reader);

}  // namespace roadfix
