/// Small textured pictures for tests: seeded noise, smoothed, so that corners and gradients are everywhere.
#pragma once

#include <opencv2/core/mat.hpp>

namespace roadfix::test {

/// Grey noise of `grain_px` sized blobs, from a seed; the same on every machine.
cv::Mat texture(int width, int height, unsigned seed, int grain_px = 6);

/// The picture moved by (du, dv) pixels, bilinear, edges repeated.
cv::Mat shifted(const cv::Mat& picture, double du, double dv);

}  // namespace roadfix::test
