#include <opencv2/features2d.hpp>

#include "features/keypoints.h"

namespace roadfix {
namespace {

class Sift final : public KeypointDetector {
 public:
  explicit Sift(const FrontEndConfig& config)
      : sift_(cv::SIFT::create(kKeypointsPerTrack * config.max_features, kLayers, kContrast)) {}

  Keypoints detect(const cv::Mat& gray) override {
    std::vector<cv::KeyPoint> keys;
    Keypoints out;
    sift_->detectAndCompute(gray, cv::noArray(), keys, out.descriptors);
    for (int row = 0; row < out.descriptors.rows; ++row) {
      cv::Mat line = out.descriptors.row(row);
      const double norm = cv::norm(line);
      if (norm > 0.0) line *= 1.0 / norm;
    }
    for (const cv::KeyPoint& key : keys) {
      out.pixels.emplace_back(key.pt.x, key.pt.y);
      out.scores.push_back(key.response);
    }
    return out;
  }

  [[nodiscard]] double max_distance() const override {
    return 0.6;
  }  // of unit vectors; unrelated descriptors have
     // about 1

 private:
  static constexpr int kKeypointsPerTrack = 4;
  static constexpr int kLayers = 3;  ///< of an octave, as published
  /// Of the grey levels' range, summed over an octave's layers; OpenCV's own is 0.04. Weak blobs fill the parts of the
  /// picture that strong ones leave empty; the ratio test and the patch tell them apart.
  static constexpr double kContrast = 0.01;
  cv::Ptr<cv::SIFT> sift_;
};

}  // namespace

std::unique_ptr<KeypointDetector> make_sift(const FrontEndConfig& config) { return std::make_unique<Sift>(config); }

}  // namespace roadfix
