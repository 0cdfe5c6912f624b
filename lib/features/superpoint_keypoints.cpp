#include <algorithm>
#include <cmath>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "features/keypoints.h"

namespace roadfix {
namespace {

constexpr int kCell = 8;  ///< px of the network's input per output cell
constexpr int kBorder = 4;
constexpr int kSuppressionRadius = 4;  ///< px of the input: radius of non-maximum suppression, as published

/// Corner probability of each pixel of the network's input: softmax over a cell's 64 pixels and "no corner".
cv::Mat heat_map(const cv::Mat& detection, int rows, int cols) {
  cv::Mat heat(rows * kCell, cols * kCell, CV_32F);
  const auto plane = static_cast<size_t>(rows) * static_cast<size_t>(cols);
  const auto* raw = detection.ptr<float>();
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

/// Vertex of the parabola through three values, in (-0.5, 0.5).
float parabola_top(float before, float middle, float after) {
  const float curvature = before - 2.0F * middle + after;
  return curvature < 0.0F ? std::clamp(0.5F * (before - after) / curvature, -0.5F, 0.5F) : 0.0F;
}

class SuperPoint final : public KeypointDetector {
 public:
  SuperPoint(const FrontEndConfig& config, std::span<const uint8_t> weights) : config_(config) {
    if (weights.empty()) throw std::invalid_argument("front end superpoint: needs its network (superpoint_model)");
    try {
      net_ = cv::dnn::readNetFromONNX(reinterpret_cast<const char*>(weights.data()), weights.size());
    } catch (const cv::Exception& e) {
      throw std::invalid_argument("front end superpoint: no network that can be read: " + e.err);
    }
    net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    const std::vector<cv::String> outputs = net_.getUnconnectedOutLayersNames();
    for (const char* name : {"output_det", "output_desc"}) {
      if (std::find(outputs.begin(), outputs.end(), name) == outputs.end()) {
        throw std::invalid_argument(std::string("front end superpoint: the network has no output ") + name);
      }
    }
  }

  Keypoints detect(const cv::Mat& gray) override {
    const auto side = [&](int length) {
      return std::max(kCell, static_cast<int>(std::lround(length * config_.superpoint_scale / kCell)) * kCell);
    };
    const cv::Size size(side(gray.cols), side(gray.rows));
    cv::Mat small;
    cv::resize(gray, small, size, 0.0, 0.0, cv::INTER_AREA);
    net_.setInput(cv::dnn::blobFromImage(small, 1.0 / 255.0));
    std::vector<cv::Mat> outputs;
    net_.forward(outputs, std::vector<cv::String>{"output_det", "output_desc"});
    const int rows = size.height / kCell, cols = size.width / kCell;
    const auto fits = [&](const cv::Mat& m) { return m.dims == 4 && m.size[2] == rows && m.size[3] == cols; };
    if (!fits(outputs[0]) || !fits(outputs[1]) || outputs[0].size[1] != 65) return {};
    const cv::Mat heat = heat_map(outputs[0], rows, cols);
    Keypoints found = peaks(heat);
    describe(outputs[1], rows, cols, found);
    const Eigen::Vector2f grow(static_cast<float>(gray.cols) / static_cast<float>(size.width),
                               static_cast<float>(gray.rows) / static_cast<float>(size.height));
    for (Eigen::Vector2f& p : found.pixels) {
      p = ((p.array() + 0.5F) * grow.array() - 0.5F).matrix();  // pixel-centre convention
    }
    return found;
  }

  [[nodiscard]] double max_distance() const override { return 0.9; }

 private:
  [[nodiscard]] Keypoints peaks(const cv::Mat& heat) const {
    cv::Mat largest;
    const int width = 2 * kSuppressionRadius + 1;
    cv::dilate(heat, largest, cv::getStructuringElement(cv::MORPH_RECT, {width, width}));
    Keypoints out;
    for (int r = kBorder; r < heat.rows - kBorder; ++r) {
      for (int c = kBorder; c < heat.cols - kBorder; ++c) {
        const float value = heat.at<float>(r, c);
        if (value < static_cast<float>(config_.superpoint_min_score) || value < largest.at<float>(r, c)) continue;
        out.pixels.emplace_back(
            static_cast<float>(c) + parabola_top(heat.at<float>(r, c - 1), value, heat.at<float>(r, c + 1)),
            static_cast<float>(r) + parabola_top(heat.at<float>(r - 1, c), value, heat.at<float>(r + 1, c)));
        out.scores.push_back(value);
      }
    }
    return out;
  }

  /// Bilinear interpolation of the coarse descriptors, normalised.
  static void describe(const cv::Mat& coarse, int rows, int cols, Keypoints& keypoints) {
    const int length = coarse.size[1];
    const auto plane = static_cast<size_t>(rows) * static_cast<size_t>(cols);
    keypoints.descriptors.create(static_cast<int>(keypoints.pixels.size()), length, CV_32F);
    const auto* raw = coarse.ptr<float>();
    for (size_t i = 0; i < keypoints.pixels.size(); ++i) {
      const Eigen::Vector2f p = (keypoints.pixels[i].array() + 0.5F) / static_cast<float>(kCell) - 0.5F;
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

  FrontEndConfig config_;
  cv::dnn::Net net_;
};

}  // namespace

std::unique_ptr<KeypointDetector> make_superpoint(const FrontEndConfig& config, std::span<const uint8_t> weights) {
  return std::make_unique<SuperPoint>(config, weights);
}

}  // namespace roadfix
