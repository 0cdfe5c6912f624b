#include "slam/two_view.h"

#include <opencv2/calib3d.hpp>

#include "geometry/frames.h"
#include "slam/triangulation.h"

namespace roadfix {
namespace {

std::vector<cv::Point2d> to_cv(std::span<const Eigen::Vector2d> points) {
  std::vector<cv::Point2d> out;
  for (const Eigen::Vector2d& p : points) out.emplace_back(p.x(), p.y());
  return out;
}

/// Number of pairs that a pure rotation (Kabsch, 1976) does not explain; with few of them the translation is not
/// observable.
int num_beyond_turning(std::span<const Eigen::Vector2d> first, std::span<const Eigen::Vector2d> second, double gate) {
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < first.size(); ++i) {
    correlation += first[i].homogeneous().normalized() * second[i].homogeneous().normalized().transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d proper = Eigen::Matrix3d::Identity();
  proper(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Matrix3d R_first_second = svd.matrixU() * proper * svd.matrixV().transpose();
  int beyond = 0;
  for (size_t i = 0; i < first.size(); ++i) {
    const Eigen::Vector3d expected = R_first_second.transpose() * first[i].homogeneous();
    beyond += (expected.hnormalized() - second[i]).norm() < gate ? 0 : 1;
  }
  return beyond;
}

}  // namespace

std::optional<TwoView> two_view_motion(std::span<const Eigen::Vector2d> first, std::span<const Eigen::Vector2d> second,
                                       const TwoViewConfig& config) {
  if (first.size() != second.size() || static_cast<int>(first.size()) < config.min_points) return std::nullopt;
  const int fewest = config.min_points / 2;
  if (num_beyond_turning(first, second, config.gate_px / config.focal_px) < fewest) return std::nullopt;
  const std::vector<cv::Point2d> a = to_cv(first), b = to_cv(second);
  constexpr double kConfidence = 0.9999;
  cv::Mat mask;
  const cv::Mat E = cv::findEssentialMat(a, b, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, kConfidence,
                                         config.gate_px / config.focal_px, mask);
  if (E.rows != 3 || E.cols != 3) return std::nullopt;
  cv::Mat R, t, near = mask.clone();  // recoverPose() keeps points closer than 50 baselines
  cv::recoverPose(E, a, b, cv::Mat::eye(3, 3, CV_64F), R, t, near);
  Eigen::Matrix3d R_second_first;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R_second_first(r, c) = R.at<double>(r, c);
  }
  const SE3 T_second_first{Eigen::Quaterniond(R_second_first).normalized(),
                           {t.at<double>(0), t.at<double>(1), t.at<double>(2)}};
  TwoView result{T_second_first.inverse(), std::vector<bool>(first.size(), false)};
  int points = 0, agreeing = 0;
  for (size_t i = 0; i < first.size(); ++i) {
    result.inlier[i] = near.at<uint8_t>(static_cast<int>(i)) != 0;
    if (mask.at<uint8_t>(static_cast<int>(i)) == 0) continue;
    const std::array<Ray, 2> rays{ray(SE3{}, first[i]), ray(result.T_first_second, second[i])};
    const bool point = triangulate(rays, config.min_angle_deg * kDegree).has_value();
    const bool far = rays[0].direction.cross(rays[1].direction).norm() < config.min_angle_deg * kDegree;
    agreeing += point || far ? 1 : 0;  // points behind the camera satisfy the epipolar constraint by chance
    points += point ? 1 : 0;
  }
  const double share = static_cast<double>(agreeing) / static_cast<double>(first.size());
  const int wanted = share > config.sure_inlier_share ? fewest : config.min_points;
  if (points < wanted || share < config.min_inlier_share) return {};
  return result;
}

}  // namespace roadfix
