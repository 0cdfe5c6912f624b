// Start in motion where nothing tells a speed, (M.50): pulling away and braking do, over seconds. The last ones are
// gone through from a guess, again and again, as (M.40) does it from a speed that is known.
#include <cmath>

#include "msckf/msckf.h"

namespace roadfix {

using namespace msckf;

namespace {

constexpr int64_t kPastUs = 4'000'000;   // gone through
constexpr int64_t kEveryUs = 1'000'000;  // between two tries
constexpr int64_t kPictureUs = 150'000;  // by which the oldest picture may be younger
constexpr int64_t kLevelUs = 250'000;    // on both sides of the beginning: the specific force is taken for gravity
// m/s: a guess that is too low approaches the truth from below, one too high overshoots to the other side of zero.
constexpr double kGuess = 6.0, kGuessStd = 15.0;
constexpr double kLeastSpeed = 1.0;  // m/s, at the beginning
constexpr double kStartAccel = 1.5;  // m/s2 along the way that levelling takes for a slope, (M.39)
// Standard deviation of the speed at the end, at most. Just told, a speed that was found too low claims to be known too
// well: both, or a highway claims too much (E12).
constexpr double kKnownShare = 0.05, kKnownStd = 0.6;  // of the speed; m/s
constexpr double kHopeless = 0.5;                      // likewise: nothing has told it
constexpr double kSettled = 0.3;         // of its standard deviation, by which the last pass may have moved the speed
constexpr double kLeastFitting = 0.5;    // of the points
constexpr int kSurePass = 3, kMost = 8;  // passes before the speed may have settled, and most

}  // namespace

std::optional<MovingStart> Msckf::plan_in_past(int64_t begin_us, int64_t end_us) const {
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  int count = 0;
  for (const ImuSample& s : imu_) {
    if (std::abs(s.t_us - begin_us) > kLevelUs) continue;
    accel += s.accel;
    ++count;
  }
  if (count == 0 || imu_.front().t_us > begin_us) return std::nullopt;
  MovingStart plan;
  plan.t_us = begin_us;
  plan.length_us = end_us - begin_us;
  plan.at.up = accel.normalized();
  plan.at.v = kGuess * state_.camera.R_imu_vehicle().col(0);
  plan.at.camera = state_.camera;
  const double aside = 0.1 + (0.05 + config_.vehicle.mounting_std) * kGuessStd;
  plan.cov_v = Eigen::Vector3d(kGuessStd, aside, aside).cwiseAbs2().asDiagonal();
  plan.tilt_std = std::hypot(0.1, kStartAccel / config_.vehicle.gravity);
  plan.scale = MsckfScale::kInertial;
  return plan;
}

bool Msckf::start_in_past(const SeenFrame& now) {
  const int64_t now_us = picture_us(now);
  while (!past_.empty() && now_us - picture_us(past_.front()) > kPastUs) past_.pop_front();
  const bool due =
      now_us >= next_past_us_ && !past_.empty() && now_us - picture_us(past_.front()) > kPastUs - kPictureUs;
  if (due) {
    next_past_us_ = now_us + kEveryUs;
    const auto plan = plan_in_past(picture_us(past_.front()), now_us);
    if (plan && try_past(*plan)) return true;
  }
  past_.push_back(now);
  return false;
}

bool Msckf::try_past(const MovingStart& plan) {
  Beginning at = plan.at;
  double before = kGuess;
  for (int pass = 1; pass <= kMost; ++pass) {
    Msckf trial(*this);
    trial.frames_ = past_;
    trial.wheels_.clear();
    trial.next_past_us_ = INT64_MAX;
    trial.go_through(plan, at, plan.t_us + plan.length_us, true);
    const std::optional<Beginning> better = trial.beginning(plan.t_us);
    if (!better || trial.reset_counter_ != reset_counter_) return false;
    const double begun = better->v.dot(plan.at.v) / kGuess, share = trial.speed_std() / trial.state_.imu.v.norm();
    if (begun < kLeastSpeed || (pass > kSurePass && share > kHopeless)) return false;
    if (pass >= kSurePass && std::abs(begun - before) < kSettled * trial.speed_std()) {
      if (share > kKnownShare || trial.speed_std() > kKnownStd || trial.used_share_ < kLeastFitting) return false;
      trial.frames_ = frames_;
      trial.wheels_ = wheels_;
      trial.next_past_us_ = next_past_us_;
      *this = std::move(trial);
      return true;
    }
    before = begun;
    at = *better;
  }
  return false;
}

}  // namespace roadfix
