/// KITTI odometry sequences: calib.txt, times.txt, image_0 and image_1 (gray) or image_2 and image_3 (colour),
/// poses.txt where there is ground truth.
#pragma once

#include <filesystem>

#include "roadfix/import/drive.h"

namespace roadfix {

/// The folder of one sequence. The body's origin is the left camera, its axes x ahead, y left, z up; the reference is
/// in a local frame. Poses may also lie where the official download has them, ../../poses/NN.txt.
Drive read_kitti(const std::filesystem::path& folder);

}  // namespace roadfix
