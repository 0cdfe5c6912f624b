/// Pictures out of messages.
#pragma once

#include <opencv2/core/mat.hpp>
#include <roadfix/image_t.hpp>

namespace roadfix {

/// 8-bit grey; empty where the bytes are no picture of the size that the message names.
cv::Mat grey_picture(const image_t& message);

}  // namespace roadfix
