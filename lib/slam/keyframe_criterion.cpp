#include "slam/keyframe_criterion.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "slam/track_shifts.h"
#include "statistics/upper_median.h"

namespace roadfix {
namespace {

constexpr double kStandingShare =
    0.4;  ///< of a keyframe's landmarks, below which a keyframe is made at a standstill too
constexpr double kCandidateShare = 0.5;        ///< point candidates over observed landmarks that trigger a keyframe
constexpr double kRedetectionSmoothing = 0.8;  ///< filter constant of the redetection rate

}  // namespace

void KeyframeCriterion::begin_keyframe(int landmarks) {
  landmarks_ = landmarks;
  after_keyframe_ = true;
}

/// Descriptors redetect about half of the landmarks in the next image, optical flow nearly all. The rate is a property
/// of the front end; only a further loss is due to motion.
void KeyframeCriterion::add_image(int num_inliers) {
  if (!std::exchange(after_keyframe_, false) || landmarks_ == 0) return;
  const double found = std::min(1.0, static_cast<double>(num_inliers) / landmarks_);
  redetection_rate_ = kRedetectionSmoothing * redetection_rate_ + (1.0 - kRedetectionSmoothing) * found;
}

/// Tracks without a point, observed in the last keyframe, that have moved by keyframe_flow_px since.
int KeyframeCriterion::num_point_candidates(const LocalMap& map, const Eigen::Quaterniond& q_now_keyframe,
                                            std::span<const Feature> features) const {
  std::vector<Feature> waiting;
  for (const Feature& f : features) {
    const Landmark* landmark = map.find(f.track);
    if (landmark != nullptr && !landmark->p_map) waiting.push_back(f);
  }
  const std::vector<double> flows = lengths_of(track_shifts(map, camera_, q_now_keyframe, waiting));
  return static_cast<int>(
      std::count_if(flows.begin(), flows.end(), [&](double flow) { return flow > config_.keyframe_flow_px; }));
}

bool KeyframeCriterion::met(const LocalMap& map, const SE3& T_map_camera, std::span<const Feature> features,
                            int num_inliers) const {
  const Eigen::Quaterniond q_now_keyframe = T_map_camera.q.conjugate() * map.last().T_map_camera.q;
  std::vector<double> flows = lengths_of(track_shifts(map, camera_, q_now_keyframe, features));
  if (flows.empty()) return true;
  const double mean = std::accumulate(flows.begin(), flows.end(), 0.0) / static_cast<double>(flows.size());
  // A standstill adds no information, but passing vehicles end tracks.
  const bool standing = upper_median(std::move(flows)) < config_.standing_flow_px;
  const double share = standing ? kStandingShare : config_.keyframe_min_share;
  if (num_inliers < share * redetection_rate_ * landmarks_) return true;
  if (num_point_candidates(map, q_now_keyframe, features) > kCandidateShare * num_inliers) return true;
  return !standing && mean > config_.keyframe_flow_px;
}

}  // namespace roadfix
