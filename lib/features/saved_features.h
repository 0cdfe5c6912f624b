/// Serialisation of features and images, shared by the front ends.
#pragma once

#include "features/front_end.h"

namespace roadfix {

void save_features(std::span<const Feature> features, StateWriter& writer);
std::vector<Feature> load_features(StateReader& reader);

/// 8-bit grey; may be empty.
void save_image(const cv::Mat& gray, StateWriter& writer);
cv::Mat load_image(StateReader& reader);

}  // namespace roadfix
