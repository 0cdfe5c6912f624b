#include "support/pictures.h"

#include <opencv2/imgproc.hpp>
#include <random>

namespace roadfix::test {

cv::Mat texture(int width, int height, unsigned seed, int grain_px) {
  std::mt19937 random(seed);
  cv::Mat coarse(height / grain_px + 2, width / grain_px + 2, CV_8UC1);
  for (int r = 0; r < coarse.rows; ++r) {
    for (int c = 0; c < coarse.cols; ++c) coarse.at<uint8_t>(r, c) = static_cast<uint8_t>(random() & 0xFFU);
  }
  cv::Mat fine;
  cv::resize(coarse, fine, cv::Size(coarse.cols * grain_px, coarse.rows * grain_px), 0, 0, cv::INTER_LINEAR);
  return fine(cv::Rect(0, 0, width, height)).clone();
}

cv::Mat shifted(const cv::Mat& picture, double du, double dv) {
  const cv::Matx23d A(1.0, 0.0, du, 0.0, 1.0, dv);
  cv::Mat out;
  cv::warpAffine(picture, out, A, picture.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

}  // namespace roadfix::test
