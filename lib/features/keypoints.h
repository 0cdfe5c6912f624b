/// Keypoints with descriptors of one image, matched by the descriptor front end.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "features/front_end.h"

namespace roadfix {

struct Keypoints {
  std::vector<Eigen::Vector2f> pixels;  ///< raw image coordinates
  std::vector<float> scores;            ///< higher is better
  cv::Mat descriptors;                  ///< one row each: CV_8U bits or CV_32F of unit norm
};

class KeypointDetector {
 public:
  KeypointDetector() = default;
  KeypointDetector(const KeypointDetector&) = delete;
  KeypointDetector& operator=(const KeypointDetector&) = delete;
  virtual ~KeypointDetector() = default;
  virtual Keypoints detect(const cv::Mat& gray) = 0;
  /// Descriptor distance above which two keypoints do not match.
  [[nodiscard]] virtual double max_distance() const = 0;
};

/// FAST corners on a pyramid, distributed over each level, with BRIEF along the direction of the intensity centroid
/// (Rublee, Rabaud, Konolige, Bradski, ORB, 2011; OpenCV's bit pattern).
std::unique_ptr<KeypointDetector> make_orb(const FrontEndConfig& config);
/// Lowe 2004, OpenCV's implementation.
std::unique_ptr<KeypointDetector> make_sift(const FrontEndConfig& config);
/// DeTone, Malisiewicz, Rabinovich 2018: a network with weights supplied by the user, as ONNX bytes. Input 1 x 1 x H x
/// W grey in [0, 1]; outputs `output_det` 1 x 65 x H/8 x W/8 (raw) and `output_desc` 1 x N x H/8 x W/8.
std::unique_ptr<KeypointDetector> make_superpoint(const FrontEndConfig& config, std::span<const uint8_t> weights);
/// Potje, Cadar, Araujo, Martins, Nascimento, XFeat, 2024: the backbone as ONNX. Input 1 x 1 (or 3) x H x W in [0, 1],
/// H and W multiples of 32; three outputs at an eighth of that size, by their channels: 65 keypoint logits,
/// 1 reliability in [0, 1], N descriptors.
std::unique_ptr<KeypointDetector> make_xfeat(const FrontEndConfig& config, std::span<const uint8_t> weights);
/// Zhao, Wu, Chen, Chen, Xu, Lee, ALIKED, 2023, as ONNX. Input as XFeat's. Either two maps: scores 1 x 1 x H x W and
/// descriptors 1 x N x H/c x W/c (ALIKE; ALIKED without its deformable head); or three lists, distinguished by their
/// sizes: keypoints K x 2 in [-1, 1] from corner pixel to corner pixel, scores K, descriptors K x N, each with or
/// without a leading 1.
std::unique_ptr<KeypointDetector> make_aliked(const FrontEndConfig& config, std::span<const uint8_t> weights);

/// BRIEF descriptors of given corners at full resolution, without corners too close to the edge.
struct DescribedCorners {
  std::vector<size_t> index;  ///< into the given corners
  cv::Mat descriptors;        ///< CV_8U, one row for each
};
DescribedCorners describe_corners(const cv::Mat& gray, std::span<const Eigen::Vector2f> corners);

/// Hamming distance of binary, Euclidean distance of float descriptors. Sums run in a fixed order.
double descriptor_distance(const cv::Mat& a, int row_a, const cv::Mat& b, int row_b);

}  // namespace roadfix
