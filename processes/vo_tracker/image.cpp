#include "vo_tracker/image.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace roadfix {
namespace {

constexpr int kMaxSide = 1 << 14;

cv::Mat decoded(const image_t& message) {
  const int width = message.width_px, height = message.height_px;
  if (width <= 0 || height <= 0 || width > kMaxSide || height > kMaxSide) return {};
  const auto pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  auto* bytes = const_cast<uint8_t*>(message.data.data());  // OpenCV wraps, and only reads
  switch (message.format) {
    case image_t::FORMAT_GRAY8:
      return message.data.size() == pixels ? cv::Mat(height, width, CV_8UC1, bytes).clone() : cv::Mat();
    case image_t::FORMAT_BGR8: {
      if (message.data.size() != 3 * pixels) return {};
      cv::Mat grey;
      cv::cvtColor(cv::Mat(height, width, CV_8UC3, bytes), grey, cv::COLOR_BGR2GRAY);
      return grey;
    }
    case image_t::FORMAT_JPEG:
    case image_t::FORMAT_PNG:
      if (message.data.empty()) return {};
      return cv::imdecode(cv::Mat(1, static_cast<int>(message.data.size()), CV_8UC1, bytes),
                          cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
    default:
      return {};
  }
}

}  // namespace

cv::Mat grey_image(const image_t& message) {
  try {
    cv::Mat image = decoded(message);
    const bool fits = image.cols == message.width_px && image.rows == message.height_px;
    return fits && image.type() == CV_8UC1 ? image : cv::Mat();
  } catch (const cv::Exception&) {  // OpenCV's reaction to damaged images
    return {};
  }
}

}  // namespace roadfix
