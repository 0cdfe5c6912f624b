#include "navigation/aiding/camera/camera_control.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"
#include "navigation/aiding/camera/common_tracks.h"
#include "statistics/chance.h"
#include "statistics/upper_median.h"

namespace roadfix::navigation {

namespace {

// Passes of (N.6.17), the share of its standard deviations by which the last one may move, and the least of those.
constexpr double kLeastVariance = 1e-16;
constexpr int kEnoughTracks = 3;      // of an update, to judge the camera by
constexpr double kLongestStep = 0.2;  // s, at most, that one picture counts for: two bad ones make no bad camera

// s, between the two pictures of a flow, at least and where there are enough, and of the newer one.
constexpr double kLeastFlowSpan = 0.25, kFlowSpan = 0.45, kFlowAge = 0.3;
constexpr double kStillMotion_px = 1.0;  // that a standing car's camera may make: an idling engine
constexpr double kRayleighMedian = 1.177, kRayleighMedianStd = 0.849;  // of unit sigma; the second over sqrt(n)

// rad and s, of the mounting and the offset: beyond, their second order (half a focal length of 600 px times the square; of
// a rate that changes by 0.3 rad/s2) passes the tracks' noise.
constexpr double kTurnKnown = 0.02, kOffsetKnown = 0.05;

bool hardly_known(const State& state) {
  const auto variance = state.P().diagonal();
  return variance.segment<3>(kCameraTurn).maxCoeff() > kTurnKnown * kTurnKnown ||
         variance(kCameraOffset) > kOffsetKnown * kOffsetKnown;
}

/// Their part of the covariance.
void columns_of(const State& state, const Columns& columns, Eigen::MatrixXd& P) {
  P.resize(columns.size(), columns.size());
  int row = 0;
  for (const auto& [at, height] : columns.blocks()) {
    int column = 0;
    for (const auto& [other, width] : columns.blocks()) {
      P.block(row, column, height, width) = state.P().block(at, other, height, width);
      column += width;
    }
    row += height;
  }
}

int64_t micros(double s) { return static_cast<int64_t>(std::llround(1e6 * s)); }

}  // namespace

CameraControl::CameraControl(const CameraTuning& tuning, const CameraFacts& facts)
    : tuning_(tuning),
      left_(facts.left),
      stamps_(facts.rate, facts.stamp_jitter),
      update_(tuning.tracks, tuning.tracks_per_update + tuning.points),
      points_(tuning.points, tuning.tracks.noise_factor) {
  if (facts.right) right_.emplace(*facts.right);
  window_.two_eyes = right_.has_value();
  chosen_.reserve(static_cast<size_t>(tuning.tracks_per_update));
}

void CameraControl::add(const TrackPicture& picture, int64_t id) {
  if (picture.t_us <= stamps_.last_us()) return;
  if (waiting_.size() >= kMostWaiting) waiting_.pop_front();
  waiting_.push_back({stamps_.on_time(picture.t_us), id, picture});
}

std::optional<int64_t> CameraControl::next_us(const Mean& x) const {
  if (waiting_.empty()) return std::nullopt;
  return waiting_.front().t_us + micros(x.camera_offset);
}

void CameraControl::restart() {
  tracks_.clear();
  fitness_ = CameraFitness::kOnTrial;
  misfit_ = trial_ = 0.0;
  pose_us_ = 0;
}

void CameraControl::begin_smoothing() {
  restart();
  presume_fit();
  smoothing_ = true;
}

void CameraControl::skip_before(int64_t t_us, const Mean& x) {
  while (next_us(x).value_or(INT64_MAX) < t_us) (void)pass_waiting();
}

void CameraControl::forget_poses(State& state) {
  tracks_.clear();
  state.drop_clones();
}

const CameraControl::TimedPicture& CameraControl::pass_waiting() {
  used_.push_back(std::move(waiting_.front()));
  waiting_.pop_front();
  while (used_.size() >= kMostWaiting || seconds_between(used_.front().t_us, used_.back().t_us) > kFlowAge + kFlowSpan)
    used_.pop_front();
  return used_.back();
}

std::optional<CameraControl::Flow> CameraControl::flow(int64_t t_us, const Mean& x) const {
  const int64_t until_us = t_us - micros(x.camera_offset);
  const TimedPicture *now = nullptr, *before = nullptr;
  const auto each_newest_first = [&](const auto& seen) {
    for (const auto* list : {&waiting_, &used_})
      for (auto p = list->rbegin(); p != list->rend(); ++p)
        if (p->t_us <= until_us) seen(*p);
  };
  double pictures = 0.0;  // from the older one to the newer
  each_newest_first([&](const TimedPicture& p) {
    if (now == nullptr) now = &p;
    if (before != nullptr && seconds_between(before->t_us, now->t_us) >= kFlowSpan) return;
    pictures += before == nullptr ? 0.0 : 1.0;
    before = &p;
  });
  if (now == nullptr || seconds_between(now->t_us, until_us) > kFlowAge) return std::nullopt;
  if (seconds_between(before->t_us, now->t_us) < kLeastFlowSpan) return std::nullopt;
  if (same_picture(before->picture, now->picture)) return std::nullopt;
  std::vector<double> moved;
  double variance = 0.0;
  for_each_common(before->picture.tracks, now->picture.tracks, [&](const TrackSighting& then, const TrackSighting& s) {
    moved.push_back((s.left - then.left).norm());
    variance += 2.0 * s.sigma_px * s.sigma_px + pictures * s.walk_px * s.walk_px;
  });
  if (moved.size() < kEnoughCommon) return std::nullopt;
  const auto count = static_cast<double>(moved.size());
  const double noise =
      std::sqrt(variance / count) * (kRayleighMedian + kChance * kRayleighMedianStd / std::sqrt(count));
  return Flow{upper_median(std::move(moved)), std::hypot(kStillMotion_px, noise)};
}

/// (N.6.21): a picture without parallax tells nothing new, and the window keeps its baseline.
bool CameraControl::makes_pose(const State& state, const SeenPicture& picture, int64_t t_us) const {
  if (smoothing_ || fitness_ != CameraFitness::kFit || hardly_known(state)) return true;
  if (state.clones.empty() || t_us - pose_us_ >= micros(tuning_.pose_interval)) return true;
  const Clone& last = state.clones.back();
  const Eigen::Matrix3d now = state.x.nav.q_level_imu * state.x.T_imu_camera.R(),
                        then = last.R * state.x.T_imu_camera.R();
  const auto parallax = tracks_.parallax(picture, last.id, now.transpose() * then);
  return !parallax || *parallax >= tuning_.pose_parallax;
}

std::optional<AidingRecord> CameraControl::use(Filter& filter, bool standing, Filter* course) {
  const int64_t t_us = *next_us(filter.state().x);
  const bool same = !used_.empty() && same_picture(used_.back().picture, waiting_.front().picture);
  const TimedPicture& now = pass_waiting();
  const SeenPicture seen = seen_picture(now.picture, left_, right_ ? &*right_ : nullptr);
  num_seen_ = static_cast<int>(seen.points.size());
  if (seen.points.empty() || standing || same || !makes_pose(filter.state(), seen, t_us)) {
    tracks_.pass(seen);
    return std::nullopt;
  }
  const double dt_s = pose_us_ == 0 ? 0.0 : seconds_between(pose_us_, t_us);
  State& state = filter.state();
  const int64_t id = next_pose_++;
  add_pose(filter, id, t_us);
  if (course != nullptr) add_pose(*course, id, t_us);
  pose_us_ = t_us;
  tracks_.add(seen, state.clones.back().id);
  const bool full = static_cast<int>(state.clones.size()) > tuning_.poses;
  // Rows along a point hold where nothing is far off.
  const bool stay = !smoothing_ && course == nullptr && fitness_ == CameraFitness::kFit && !hardly_known(state);
  if (!stay) points_.forget(state);
  points_.see(state, tracks_);
  choose_tracks(state, full, stay);
  try_tracks(state, course != nullptr ? &course->state() : nullptr);
  const bool iterated = !smoothing_ && hardly_known(state) &&
                        update_.counts().residual_sum > tuning_.iterate_above * update_.counts().dof_sum;
  std::optional<State> settled;
  if (iterated) settled = iterate(state);
  judge(dt_s);
  const TrackCounts& counts = update_.counts();
  AidingRecord record = record_of(AidingSource::kCameraTracks, AidingStatus::kGated, now.picture.t_us, now.id);
  // Hundreds of rows are reported as one: their mean square.
  if (counts.dof_sum > 0) {
    record.nis = counts.nis_sum / counts.dof_sum;
    record.dof = 1;
    record.innovation[0] = std::sqrt(record.nis);
    record.innovation_variance[0] = 1.0;
  }
  if (fitness_ == CameraFitness::kFit && counts.used > 0) {
    if (!iterated) {
      if (course == nullptr) update_.weigh_together();
      record.status = apply(state) ? AidingStatus::kAccepted : AidingStatus::kBadInput;
    } else if (settled) {
      state = std::move(*settled);
      record.status = AidingStatus::kAccepted;
    }
  } else if (fitness_ != CameraFitness::kFit) {
    record.status = AidingStatus::kBadQuality;
  }
  points_.drop_refused(state);
  if (full) drop_oldest(state, course != nullptr ? &course->state() : nullptr);
  return counts.tried() > 0 ? std::optional(record) : std::nullopt;
}

void CameraControl::add_pose(Filter& filter, int64_t id, int64_t t_us) const {
  filter.flush();
  State& state = filter.state();
  const Mean& x = state.x;
  state.move_reference(x.nav.position);
  // Over the sample that the picture lies in: a smoothed rate would miss a hundredth of a radian of a rough road.
  const Eigen::Vector3d rate =
      filter.propagation().last_step().rate - x.nav.q_level_imu.conjugate() * filter.earth().rate();
  state.add_clone(id, rate, stamps_.jitter());
  // From the imu's epoch to the picture's moment.
  const double dt = seconds_between(x.t_us, t_us);
  Clone& pose = state.clones.back();
  pose.t_us = t_us;
  pose.R = pose.R * exp_so3(dt * rate);
  pose.p += dt * x.nav.velocity;
  const int n = state.size(), at = pose.at + 3;
  Eigen::MatrixXd& P = state.P();
  P.block(at, 0, 3, n) += dt * P.block(kVel, 0, 3, n);
  P.block(0, at, n, 3) += dt * P.block(0, kVel, n, 3);
  P.block<3, 3>(at, at) = (0.5 * (P.block<3, 3>(at, at) + P.block<3, 3>(at, at).transpose())).eval();
  if (state.held()) state.expected().segment<3>(at) += dt * state.expected().segment<3>(kVel);
  state.carried().middleRows<3>(at) += dt * state.carried().middleRows<3>(kVel);
}

void CameraControl::choose_tracks(const State& state, bool full, bool stay) {
  chosen_.clear();
  const int64_t oldest = state.clones.front().id;
  const auto room = static_cast<size_t>(tuning_.tracks_per_update);
  // Longest first: their sightings tell most, and there is a limit to what one picture may cost.
  for (int wanted = kMaxViews; wanted >= tuning_.tracks.min_sightings; --wanted) {
    for (Track& track : tracks_.tracks()) {
      if (chosen_.size() >= room) break;
      const bool leaving = full && track.count > 0 && track.seen.front().clone == oldest;
      if (track.count != wanted || (track.alive && !leaving) || state.has_point(track.track)) continue;
      ChosenTrack& chosen = chosen_.emplace_back();
      chosen.track = track.track;
      chosen.stays = stay && track.alive;
      chosen.count = static_cast<size_t>(track.count);
      for (size_t i = 0; i < chosen.count; ++i) {
        const Sighting& s = track.seen[i];
        const auto view = static_cast<int>(state.find_clone(s.clone) - state.clones.data());
        chosen.seen[i] = {view, s.left, s.right, s.sigma_px, s.walk_px2, s.right_sigma_px};
      }
      track.use_up();
    }
  }
  tracks_.drop_ended();
}

void CameraControl::try_tracks(const State& state, const State* course) {
  const Mean& x = state.x;
  window_.camera = {x.T_imu_camera, x.lens, x.T_left_right, x.track_drift};
  window_.views.clear();
  double way = 0.0;
  for (const Clone& c : state.clones) {
    const Eigen::Vector3d p = c.p - state.p_ref;
    if (!window_.views.empty()) way += (p - window_.views.back().p).norm();
    window_.views.push_back({c.R, p, way});
  }
  window_.points = static_cast<int>(state.points.size());
  const Columns columns(state);
  columns_of(state, columns, window_.P);
  window_.P_course.resize(0, 0);
  if (course != nullptr) columns_of(*course, columns, window_.P_course);
  window_.expected.resize(state.held() ? columns.size() : 0);
  int row = 0;
  for (const auto& [at, height] : columns.blocks()) {
    if (state.held()) window_.expected.segment(row, height) = state.expected().segment(at, height);
    row += height;
  }
  update_.begin(window_);
  points_.measure(state, update_);
  for (const ChosenTrack& track : chosen_) {
    const std::span<const ViewSighting> seen(track.seen.data(), track.count);
    if (!track.stays || !points_.room(state)) {
      (void)update_.add(seen);
    } else if (const auto point = update_.place(seen)) {
      points_.wait(track.track, *point);
    }
  }
}

bool CameraControl::apply(State& state) {
  const Columns columns(state);
  points_.join(state, columns);
  rows_.begin(state);
  rows_.add(update_.rows(), columns);
  return rows_.apply(state);
}

/// (N.6.17): the state after an iterated update; nothing where it breaks or does not settle.
std::optional<State> CameraControl::iterate(const State& prior) {
  const int n = prior.size();
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(n);
  for (int pass = 0; pass < Iteration::kMostPasses; ++pass) {
    State state = prior;
    state.retract(moved);
    // About these means the prior expects the errors that lead back to its own.
    state.hold(BaseVector::Zero());
    state.expected().head(n) = -moved;
    try_tracks(state);
    if (update_.counts().used == 0 || !apply(state)) return std::nullopt;
    const Eigen::VectorXd step = state.expected().head(n);
    moved += step;
    const Eigen::ArrayXd sigma = state.P().diagonal().head(n).array().max(kLeastVariance).sqrt();
    if (pass == 0 || (step.array().abs() / sigma).maxCoeff() > Iteration::kSettled) continue;
    state.release();
    return state;
  }
  return std::nullopt;
}

/// (N.6.14): a camera whose tracks do not fit what else is known, turned, late, or looking at its own cover, is not used
/// until they have fitted for long.
void CameraControl::judge(double dt_s) {
  const TrackCounts& counts = update_.counts();
  if (counts.tried() < kEnoughTracks) return;
  const double step = std::min(dt_s, kLongestStep);
  const double misfit = update_.misfit();
  const double share = 1.0 - std::exp(-step / tuning_.judged_over);
  misfit_ += share * (misfit - misfit_);
  if (smoothing_) return;
  switch (fitness_) {
    case CameraFitness::kFit:
      if (misfit_ > tuning_.unfit_above) {
        fitness_ = CameraFitness::kUnfit;
        trial_ = 0.0;
      }
      break;
    case CameraFitness::kOnTrial:
    case CameraFitness::kUnfit: {
      trial_ = misfit < tuning_.fit_below ? trial_ + step : std::max(0.0, trial_ - step);
      const double wanted = fitness_ == CameraFitness::kOnTrial ? tuning_.trial : tuning_.trial_again;
      if (trial_ >= wanted && misfit_ < tuning_.fit_below) fitness_ = CameraFitness::kFit;
      break;
    }
  }
}

void CameraControl::drop_oldest(State& state, State* course) {
  const int64_t oldest = state.clones.front().id;
  points_.leave_clone(state, oldest);
  tracks_.forget_clone(oldest);
  state.remove_clone(oldest);
  if (course != nullptr) course->remove_clone(oldest);
}

}  // namespace roadfix::navigation
