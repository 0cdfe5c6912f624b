#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "features/network.h"
#include "features/network_maps.h"

namespace roadfix {
namespace {

constexpr int kMultiple = 32;    ///< of the input's sides, as the backbone's strides need it
constexpr int kXfeatRadius = 2;  ///< px: a window of 5, as published
constexpr int kXfeatBorder = 4;
/// Descriptors match above a cosine of 0.82, as published: unit vectors are then sqrt(2 - 2 * 0.82) apart.
constexpr double kMaxDistance = 0.6;

/// Which output is which, by its number of channels.
struct Outputs {
  const cv::Mat* logits = nullptr;       ///< 65
  const cv::Mat* reliability = nullptr;  ///< 1
  const cv::Mat* descriptors = nullptr;  ///< any other number
};

Outputs sorted(const std::vector<cv::Mat>& all, int rows, int cols) {
  Outputs out;
  for (const cv::Mat& m : all) {
    if (m.dims != 4 || m.size[0] != 1 || m.size[2] != rows || m.size[3] != cols) continue;
    (m.size[1] == 65 ? out.logits : m.size[1] == 1 ? out.reliability : out.descriptors) = &m;
  }
  if (out.logits == nullptr || out.reliability == nullptr || out.descriptors == nullptr) {
    throw std::invalid_argument(
        "front end xfeat: the network does not give 65, 1 and N channels at an eighth of the picture's size");
  }
  return out;
}

class XFeat final : public KeypointDetector {
 public:
  XFeat(const FrontEndConfig& config, std::span<const uint8_t> weights) : config_(config), network_("xfeat", weights) {
    static_cast<void>(
        detect(cv::Mat::zeros(2 * kMultiple, 2 * kMultiple, CV_8UC1)));  // refuses a wrong network at once
  }

  Keypoints detect(const cv::Mat& gray) override {
    const cv::Mat small = network_input(gray, config_.xfeat_scale, kMultiple);
    const std::vector<cv::Mat> all = network_.run(small);
    const Outputs outputs = sorted(all, small.rows / kNetworkCell, small.cols / kNetworkCell);
    Keypoints found = peaks(heat_map(*outputs.logits), config_.xfeat_min_score, kXfeatRadius, kXfeatBorder);
    weigh(*outputs.reliability, found);
    describe(*outputs.descriptors, kNetworkCell, found);
    enlarge(small.size(), gray.size(), found);
    return found;
  }

  [[nodiscard]] double max_distance() const override { return kMaxDistance; }

 private:
  /// The score is the corner probability times the reliability there: the best keypoints are begun first.
  static void weigh(const cv::Mat& reliability, Keypoints& keypoints) {
    cv::Mat fine;
    const cv::Mat coarse = first_channel(reliability);
    cv::resize(coarse, fine, coarse.size() * kNetworkCell, 0.0, 0.0, cv::INTER_LINEAR);
    for (size_t i = 0; i < keypoints.pixels.size(); ++i) {
      const Eigen::Vector2i p = keypoints.pixels[i].array().round().cast<int>();
      keypoints.scores[i] *= fine.at<float>(p.y(), p.x());
    }
  }

  FrontEndConfig config_;
  Network network_;
};

}  // namespace

std::unique_ptr<KeypointDetector> make_xfeat(const FrontEndConfig& config, std::span<const uint8_t> weights) {
  return std::make_unique<XFeat>(config, weights);
}

}  // namespace roadfix
