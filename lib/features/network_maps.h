/// From the maps that networks give to keypoints: what the learned front ends share.
#pragma once

#include "features/keypoints.h"

namespace roadfix {

constexpr int kNetworkCell = 8;  ///< px of the network's input that share one cell of a coarse output

/// Probability of a corner in each pixel of the network's input: softmax over a cell's 64 pixels and "none", of a
/// 1 x 65 x rows x cols output (DeTone et al. 2018, section 3.2).
cv::Mat heat_map(const cv::Mat& logits);

/// The first channel of a 1 x C x rows x cols output, not copied.
cv::Mat first_channel(const cv::Mat& output);

/// Local maxima of at least `min_score`, none other within `suppression_radius`, `border` px from the edge, refined to the
/// top of a parabola.
Keypoints peaks(const cv::Mat& heat, double min_score, int suppression_radius, int border);

/// Bilinear samples of a 1 x N x rows x cols map at the keypoints, to unit norm. `cell`: px of the keypoints that share
/// one element of the map.
void describe(const cv::Mat& map, double cell, Keypoints& keypoints);

/// From pixels of the network's input to those of the picture: centres of pixels on centres of pixels.
void enlarge(const cv::Size& from, const cv::Size& to, Keypoints& keypoints);

/// The picture as the network takes it: shrunk by `scale`, each side a multiple of `multiple`.
cv::Mat network_input(const cv::Mat& gray, double scale, int multiple);

}  // namespace roadfix
