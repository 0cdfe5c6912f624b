/// Decodes image messages.
#pragma once

#include <opencv2/core/mat.hpp>
#include <roadfix/image_t.hpp>

namespace roadfix {

/// 8-bit grey; empty where the bytes are no image of the size in the message.
cv::Mat grey_image(const image_t& message);

}  // namespace roadfix
