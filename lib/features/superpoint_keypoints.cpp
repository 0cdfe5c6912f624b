#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "features/network.h"
#include "features/network_maps.h"

namespace roadfix {
namespace {

constexpr int kSuperpointBorder = 4;
constexpr int kSuperpointRadius = 4;  ///< px of the input: radius of non-maximum suppression, as published

class SuperPoint final : public KeypointDetector {
 public:
  SuperPoint(const FrontEndConfig& config, std::span<const uint8_t> weights)
      : config_(config),
        network_("superpoint", weights),
        detection_(index_of("output_det")),
        descriptors_(index_of("output_desc")) {}

  Keypoints detect(const cv::Mat& gray) override {
    const double scale = std::sqrt(config_.superpoint_pixels / static_cast<double>(gray.total()));
    const cv::Mat small = network_input(gray, std::min(1.0, scale), kNetworkCell);
    const std::vector<cv::Mat> outputs = network_.run(small);
    const cv::Mat &detection = outputs[detection_], &descriptors = outputs[descriptors_];
    const int rows = small.rows / kNetworkCell, cols = small.cols / kNetworkCell;
    const auto fits = [&](const cv::Mat& m) { return m.dims == 4 && m.size[2] == rows && m.size[3] == cols; };
    if (!fits(detection) || !fits(descriptors) || detection.size[1] != 65) return {};
    Keypoints found = peaks(heat_map(detection), config_.superpoint_min_score, kSuperpointRadius, kSuperpointBorder);
    describe(descriptors, kNetworkCell, found);
    enlarge(small.size(), gray.size(), found);
    return found;
  }

  [[nodiscard]] double max_distance() const override { return 0.9; }

 private:
  [[nodiscard]] size_t index_of(const std::string& name) const {
    const std::vector<std::string>& names = network_.outputs();
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) throw std::invalid_argument("front end superpoint: the network has no output " + name);
    return static_cast<size_t>(found - names.begin());
  }

  FrontEndConfig config_;
  Network network_;
  size_t detection_, descriptors_;
};

}  // namespace

std::unique_ptr<KeypointDetector> make_superpoint(const FrontEndConfig& config, std::span<const uint8_t> weights) {
  return std::make_unique<SuperPoint>(config, weights);
}

}  // namespace roadfix
