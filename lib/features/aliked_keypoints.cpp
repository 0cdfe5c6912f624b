#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "features/network.h"
#include "features/network_maps.h"

namespace roadfix {
namespace {

constexpr int kMultiple = 32;     ///< of the input's sides, as the encoder's poolings need it
constexpr int kAlikedRadius = 2;  ///< px, as published
constexpr int kAlikedBorder = 4;
/// Descriptors match above a cosine of 0.75, as published: unit vectors are then sqrt(2 - 2 * 0.75) apart.
constexpr double kMaxDistance = 0.707;

/// Size of a matrix with or without leading dimensions of one; 1 x K is a column.
std::optional<cv::Size> matrix_size(const cv::Mat& m) {
  std::vector<int> sizes;
  for (int i = 0; i < m.dims; ++i) sizes.push_back(m.size[i]);
  while (sizes.size() > 2 && sizes.front() == 1) sizes.erase(sizes.begin());
  if (sizes.size() != 2) return std::nullopt;
  if (m.dims == 2 && sizes[0] == 1) std::swap(sizes[0], sizes[1]);
  return cv::Size(sizes[1], sizes[0]);
}

class Aliked final : public KeypointDetector {
 public:
  Aliked(const FrontEndConfig& config, std::span<const uint8_t> weights)
      : config_(config), network_("aliked", weights) {
    static_cast<void>(
        detect(cv::Mat::zeros(2 * kMultiple, 2 * kMultiple, CV_8UC1)));  // refuses a wrong network at once
  }

  Keypoints detect(const cv::Mat& gray) override {
    const cv::Mat small = network_input(gray, config_.aliked_scale, kMultiple);
    const std::vector<cv::Mat> outputs = network_.run(small);
    Keypoints found = outputs.size() == 2 ? of_maps(outputs, small) : of_lists(outputs, small);
    enlarge(small.size(), gray.size(), found);
    return found;
  }

  [[nodiscard]] double max_distance() const override { return kMaxDistance; }

 private:
  [[noreturn]] static void refuse() {
    throw std::invalid_argument(
        "front end aliked: the network gives neither a score map of the picture's size with a map of descriptors, nor "
        "K "
        "x 2 keypoints, K scores and K x N descriptors");
  }

  [[nodiscard]] Keypoints of_maps(const std::vector<cv::Mat>& outputs, const cv::Mat& small) const {
    const auto scores = std::find_if(outputs.begin(), outputs.end(), [&](const cv::Mat& m) {
      return m.dims == 4 && m.size[1] == 1 && m.size[2] == small.rows && m.size[3] == small.cols;
    });
    if (scores == outputs.end()) refuse();
    const cv::Mat& map = outputs[scores == outputs.begin() ? 1 : 0];
    if (map.dims != 4 || map.size[2] < 1 || map.size[3] < 1) refuse();
    if (small.rows % map.size[2] != 0 || small.cols * map.size[2] != small.rows * map.size[3]) refuse();
    Keypoints found = peaks(first_channel(*scores), config_.aliked_min_score, kAlikedRadius, kAlikedBorder);
    describe(map, static_cast<double>(small.rows) / map.size[2], found);
    return found;
  }

  [[nodiscard]] Keypoints of_lists(const std::vector<cv::Mat>& outputs, const cv::Mat& small) const {
    if (outputs.size() != 3) refuse();
    const cv::Mat *places = nullptr, *scores = nullptr, *descriptors = nullptr;
    for (const cv::Mat& m : outputs) {
      const std::optional<cv::Size> size = matrix_size(m);
      if (!size) refuse();
      (size->width == 2 ? places : size->width == 1 ? scores : descriptors) = &m;
    }
    if (places == nullptr || scores == nullptr || descriptors == nullptr) refuse();
    const cv::Size size = *matrix_size(*descriptors);
    if (matrix_size(*places)->height != size.height || matrix_size(*scores)->height != size.height) refuse();
    const Eigen::Vector2f half(0.5F * static_cast<float>(small.cols - 1), 0.5F * static_cast<float>(small.rows - 1));
    const cv::Mat rows(size, CV_32F, const_cast<float*>(descriptors->ptr<float>()));
    Keypoints found;
    found.descriptors.create(0, size.width, CV_32F);
    for (int i = 0; i < size.height; ++i) {
      const float score = scores->ptr<float>()[i];
      const float* place = places->ptr<float>() + 2 * i;
      const double norm = cv::norm(rows.row(i));
      const bool inside = std::abs(place[0]) <= 1.0F && std::abs(place[1]) <= 1.0F;  // false for NaN
      if (!(score >= static_cast<float>(config_.aliked_min_score)) || !inside || !(norm > 0.0)) continue;
      found.pixels.emplace_back((place[0] + 1.0F) * half.x(), (place[1] + 1.0F) * half.y());
      found.scores.push_back(score);
      found.descriptors.push_back(cv::Mat(rows.row(i) / norm));
    }
    return found;
  }

  FrontEndConfig config_;
  Network network_;
};

}  // namespace

std::unique_ptr<KeypointDetector> make_aliked(const FrontEndConfig& config, std::span<const uint8_t> weights) {
  return std::make_unique<Aliked>(config, weights);
}

}  // namespace roadfix
