#include "slam/initialiser.h"

#include <algorithm>

#include "samples/samples.h"
#include "slam/two_view.h"
#include "statistics/upper_median.h"

namespace roadfix {
namespace {

constexpr double kMaxReverseSpeed = 5.0;  ///< m/s
constexpr double kBackwardsCosine = 0.5;  ///< with margin for the mounting
constexpr double kNearFlowFactor = 2.0;   ///< times start_flow_px: flow of near tracks, sufficient on their own
constexpr double kMinBaseline = 0.01;     ///< m

}  // namespace

TrackState Initialiser::state_without_map(int64_t t_us, bool usable, bool had_pose) {
  if (usable || !usable_us_) usable_us_ = t_us;
  const bool lost = had_pose || seconds_between(*usable_us_, t_us) >= config_.lost_after_s;
  return lost ? TrackState::kLost : TrackState::kInitialising;
}

InitialisationStep Initialiser::track(const CameraFrame& frame, const CameraState& camera, const MotionPrior& prior,
                                      FeatureTracks& tracks, TrackedFrame& out) {
  const std::vector<Feature> features = tracks.track(frame.left);
  out.num_expected = tracks.num_expected();
  out.num_matches = static_cast<int>(features.size());
  for (const Feature& f : features) out.features.push_back({f, FeatureStatus::kMatched});
  InitialisationStep step;
  step.is_first = !first_;
  if (first_) {
    CommonTracks common = common_tracks(features);
    wait_for_parallax(frame.t_us, common.now.size(), camera.had_pose(), out);
    step.standing = common.now.size() > 1 && upper_median(common.flow_px) < config_.standing_flow_px;
    // Near tracks leave the image first and the remaining ones move little: try a short baseline rather than none. The
    // parallax check decides.
    const bool last_chance = 2 * common.now.size() < first_->seen.size();
    if (last_chance || enough_parallax(common)) step.map = solve(common, frame.t_us, camera.T_map_camera, prior);
    if (step.map) take_tracks(common, *step.map, tracks, out);
    step.is_first = last_chance && !step.map;
  }
  if (step.is_first) {
    begin(frame.t_us, features, tracks, out);
    wait_for_parallax(frame.t_us, first_->seen.size(), camera.had_pose(), out);
  }
  if (step.map) first_.reset();
  return step;
}

void Initialiser::begin(int64_t t_us, std::vector<Feature> features, FeatureTracks& tracks, TrackedFrame& out) {
  for (const Feature& f : tracks.replenish()) {
    features.push_back(f);
    out.features.push_back({f, FeatureStatus::kNew});
  }
  first_ = FirstImage{t_us, {}};
  for (const Feature& f : features) {
    if (const auto normalised = camera_.unproject(f.pixel.cast<double>())) first_->seen[f.track] = *normalised;
  }
}

void Initialiser::wait_for_parallax(int64_t t_us, size_t points, bool had_pose, TrackedFrame& out) {
  const bool usable = static_cast<int>(points) >= config_.start_points;
  out.state = state_without_map(t_us, usable, had_pose);
  out.reason = usable ? "waiting for parallax" : "too few points in the picture";
}

Initialiser::CommonTracks Initialiser::common_tracks(std::span<const Feature> features) const {
  CommonTracks common;
  for (const Feature& f : features) {
    const auto normalised = camera_.unproject(f.pixel.cast<double>());
    if (!first_->seen.contains(f.track) || !normalised) continue;
    common.now.push_back(f);
    common.first.push_back(first_->seen.at(f.track));
    common.second.push_back(*normalised);
    common.flow_px.push_back(camera_.focal() * (common.second.back() - common.first.back()).norm());
  }
  return common;
}

bool Initialiser::enough_parallax(const CommonTracks& common) const {
  // On a highway most tracks are too far away to move: count the near ones.
  const double near_px = kNearFlowFactor * config_.start_flow_px;
  const auto near =
      std::count_if(common.flow_px.begin(), common.flow_px.end(), [near_px](double px) { return px >= near_px; });
  return upper_median(common.flow_px) >= config_.start_flow_px || near >= config_.start_points;
}

std::optional<TwoViewMap> Initialiser::solve(CommonTracks& common, int64_t t_us, const SE3& T_map_first,
                                             const MotionPrior& prior) const {
  TwoViewConfig config;
  config.focal_px = camera_.focal();
  config.gate_px = config_.gate_px;
  config.min_angle_deg = config_.min_parallax_deg;
  config.min_points = config_.start_points;
  const auto motion = two_view_motion(common.first, common.second, config);
  if (!motion) return std::nullopt;
  TwoViewMap map;
  map.measured = prior.distance.of_camera(first_->t_us, SE3{}, t_us, motion->T_first_second);
  const double dt_s = seconds_between(first_->t_us, t_us);
  double baseline = 1.0;  // arbitrary unit
  if (map.measured) {
    const TravelledDistance& travelled = map.measured->travelled;
    // Mismatched posts and lane markings appear as backward motion; a car at this speed does not reverse.
    const Eigen::Vector3d ahead = q_camera_vehicle_ * Eigen::Vector3d::UnitX();
    const bool forwards = !travelled.backwards && travelled.distance > kMaxReverseSpeed * dt_s;
    if (forwards && motion->T_first_second.p.dot(ahead) < -kBackwardsCosine) return std::nullopt;
    baseline = std::max(kMinBaseline, travelled.distance);
  } else if (prior.velocity.known()) {  // speed before the loss, or of a pull-away
    baseline = std::max({kMinBaseline, prior.velocity.speed() * dt_s, unmeasured_displacement(dt_s)});
  }
  common.inlier = motion->inlier;
  for (size_t i = 0; i < common.now.size(); ++i) {
    if (!motion->inlier[i]) continue;
    map.first_features.push_back({common.now[i].track, common.first[i], {}});
    map.second_features.push_back({common.now[i].track, common.second[i], {}});
  }
  const SE3 T_map_second = T_map_first * SE3{motion->T_first_second.q, baseline * motion->T_first_second.p};
  map.first = {0, first_->t_us, T_map_first, {}, LensSensitivity::Zero(), {}};
  map.second = {0, t_us, T_map_second, baseline, LensSensitivity::Zero(), {}};
  return map;
}

/// Outlier tracks end; new ones start in the second image, needed when the first ones leave it.
void Initialiser::take_tracks(const CommonTracks& common, TwoViewMap& map, FeatureTracks& tracks,
                              TrackedFrame& out) const {
  tracks.deactivate_all();
  std::vector<int64_t> outliers;
  auto used = out.features.begin();  // both in ascending order of track
  for (size_t i = 0; i < common.now.size(); ++i) {
    const Feature& f = common.now[i];
    while (used->feature.track != f.track) ++used;
    used->status = common.inlier[i] ? FeatureStatus::kInlier : FeatureStatus::kOutlier;
    if (common.inlier[i]) {
      tracks.activate(f);
    } else {
      outliers.push_back(f.track);
    }
  }
  tracks.drop(outliers);
  out.num_landmarks_seen = static_cast<int>(common.now.size());
  out.num_inliers = static_cast<int>(map.first_features.size());
  for (const Feature& f : tracks.replenish()) {
    out.features.push_back({f, FeatureStatus::kNew});
    const auto normalised = camera_.unproject(f.pixel.cast<double>());
    if (!normalised) continue;
    map.second_features.push_back({f.track, *normalised, {}});
    tracks.activate(f);
  }
}

}  // namespace roadfix
