#include "features/network_maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace roadfix {
namespace {

constexpr int kCell = kNetworkCell;

/// Vertex of the parabola through three values, in (-0.5, 0.5).
float parabola_top(float before, float middle, float after) {
  const float curvature = before - 2.0F * middle + after;
  return curvature < 0.0F ? std::clamp(0.5F * (before - after) / curvature, -0.5F, 0.5F) : 0.0F;
}

}  // namespace

cv::Mat heat_map(const cv::Mat& logits) {
  const int rows = logits.size[2], cols = logits.size[3];
  cv::Mat heat(rows * kCell, cols * kCell, CV_32F);
  const auto plane = static_cast<size_t>(rows) * static_cast<size_t>(cols);
  const auto* raw = logits.ptr<float>();
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < cols; ++c) {
      const float* cell = raw + static_cast<size_t>(r) * static_cast<size_t>(cols) + static_cast<size_t>(c);
      std::array<float, 65> value{};
      float largest = -1e30F;
      for (size_t k = 0; k < 65; ++k) largest = std::max(largest, value.at(k) = cell[k * plane]);
      float sum = 0.0F;
      for (float& v : value) sum += v = std::exp(v - largest);
      for (int k = 0; k < 64; ++k) {
        heat.at<float>(r * kCell + k / kCell, c * kCell + k % kCell) = value.at(static_cast<size_t>(k)) / sum;
      }
    }
  }
  return heat;
}

cv::Mat first_channel(const cv::Mat& output) {
  return {output.size[2], output.size[3], CV_32F, const_cast<float*>(output.ptr<float>())};
}

Keypoints peaks(const cv::Mat& heat, double min_score, int suppression_radius, int border) {
  cv::Mat largest;
  const int width = 2 * suppression_radius + 1;
  cv::dilate(heat, largest, cv::getStructuringElement(cv::MORPH_RECT, {width, width}));
  Keypoints out;
  for (int r = border; r < heat.rows - border; ++r) {
    for (int c = border; c < heat.cols - border; ++c) {
      const float value = heat.at<float>(r, c);
      if (value < static_cast<float>(min_score) || value < largest.at<float>(r, c)) continue;
      out.pixels.emplace_back(
          static_cast<float>(c) + parabola_top(heat.at<float>(r, c - 1), value, heat.at<float>(r, c + 1)),
          static_cast<float>(r) + parabola_top(heat.at<float>(r - 1, c), value, heat.at<float>(r + 1, c)));
      out.scores.push_back(value);
    }
  }
  return out;
}

void describe(const cv::Mat& map, double cell, Keypoints& keypoints) {
  const int rows = map.size[2], cols = map.size[3];
  const int length = map.size[1];
  const auto plane = static_cast<size_t>(rows) * static_cast<size_t>(cols);
  keypoints.descriptors.create(static_cast<int>(keypoints.pixels.size()), length, CV_32F);
  const auto* raw = map.ptr<float>();
  for (size_t i = 0; i < keypoints.pixels.size(); ++i) {
    const Eigen::Vector2f p = (keypoints.pixels[i].array() + 0.5F) / static_cast<float>(cell) - 0.5F;
    const float x = std::clamp(p.x(), 0.0F, static_cast<float>(cols - 1));
    const float y = std::clamp(p.y(), 0.0F, static_cast<float>(rows - 1));
    const auto x0 = static_cast<size_t>(x), y0 = static_cast<size_t>(y);
    const size_t x1 = std::min(x0 + 1, static_cast<size_t>(cols - 1));
    const size_t y1 = std::min(y0 + 1, static_cast<size_t>(rows - 1));
    const float a = x - static_cast<float>(x0), b = y - static_cast<float>(y0);
    auto* row = keypoints.descriptors.ptr<float>(static_cast<int>(i));
    float sum = 0.0F;
    for (int k = 0; k < length; ++k) {
      const float* at = raw + static_cast<size_t>(k) * plane;
      const auto value = [&](size_t r, size_t c) { return at[r * static_cast<size_t>(cols) + c]; };
      row[k] = (1.0F - b) * ((1.0F - a) * value(y0, x0) + a * value(y0, x1)) +
               b * ((1.0F - a) * value(y1, x0) + a * value(y1, x1));
      sum += row[k] * row[k];
    }
    const float scale = sum > 0.0F ? 1.0F / std::sqrt(sum) : 0.0F;
    for (int k = 0; k < length; ++k) row[k] *= scale;
  }
}

void enlarge(const cv::Size& from, const cv::Size& to, Keypoints& keypoints) {
  const Eigen::Vector2f factor(static_cast<float>(to.width) / static_cast<float>(from.width),
                               static_cast<float>(to.height) / static_cast<float>(from.height));
  for (Eigen::Vector2f& p : keypoints.pixels) p = ((p.array() + 0.5F) * factor.array() - 0.5F).matrix();
}

cv::Mat network_input(const cv::Mat& gray, double scale, int multiple) {
  const auto side = [&](int length) {
    return std::max(multiple, static_cast<int>(std::lround(length * scale / multiple)) * multiple);
  };
  cv::Mat small;
  cv::resize(gray, small, {side(gray.cols), side(gray.rows)}, 0.0, 0.0, cv::INTER_AREA);
  return small;
}

}  // namespace roadfix
