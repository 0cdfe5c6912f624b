#include "slam/tracked_frame.h"

#include <opencv2/core.hpp>

namespace roadfix {

TrackedFrame TrackedFrame::next(int64_t t_us) const {
  TrackedFrame frame;
  frame.odometry.t_us = t_us;
  frame.reset_counter = reset_counter;
  frame.reset_delta = reset_delta;
  frame.closed_reset_counter = closed_reset_counter;
  frame.closed_reset_delta = closed_reset_delta;
  return frame;
}

void TrackedFrame::count_reset(const SE3& delta) {
  ++reset_counter;
  ++closed_reset_counter;
  reset_delta = closed_reset_delta = delta;
}

ImageCheck check_images(const CameraFrame& frame, const CameraRig& rig, double min_contrast) {
  const auto fits = [](const cv::Mat& image, const CameraIntrinsics& lens) {
    return image.type() == CV_8UC1 && image.cols == lens.width && image.rows == lens.height;
  };
  if (frame.left.empty()) return {"the picture cannot be read"};
  if (!fits(frame.left, rig.left)) return {"the picture does not have the size of the calibration"};
  if (rig.right && !frame.right.empty() && !fits(frame.right, *rig.right)) return {"the right picture does not fit"};
  cv::Scalar mean, deviation;
  cv::meanStdDev(frame.left, mean, deviation);
  if (deviation[0] >= min_contrast) return {{}, mean[0]};
  return {mean[0] < 128.0 ? "the picture is dark" : "the picture is blank", mean[0]};
}

std::vector<int64_t> outlier_tracks(const TrackedFrame& frame) {
  std::vector<int64_t> tracks;
  for (const TrackedFeature& f : frame.features) {
    if (f.status == FeatureStatus::kOutlier) tracks.push_back(f.feature.track);
  }
  return tracks;
}

void set_right_pixels(const std::vector<Feature>& features, const std::vector<std::optional<Eigen::Vector2f>>& right,
                      TrackedFrame& frame) {
  auto used = frame.features.begin();
  for (size_t i = 0; i < features.size(); ++i) {
    while (used != frame.features.end() && used->feature.track < features[i].track) ++used;
    if (used != frame.features.end() && used->feature.track == features[i].track) used->right = right[i];
  }
}

SE3 pose_change(const SE3& T_old, const SE3& T_new) { return {T_old.q.conjugate() * T_new.q, T_new.p - T_old.p}; }

}  // namespace roadfix
