#include "fusion/lookahead.h"

#include <algorithm>

namespace roadfix {
namespace {

constexpr double kLongestGap = 0.3;  ///< s, over which velocities are the motion

}  // namespace

void Lookahead::see(const ChannelSample& sample) {
  Entry now{sample, level_view(sample.odometry), Planar::Zero(), 0.0, false, Planar::Zero()};
  const Entry* before = ahead_.empty() ? (last_ ? &*last_ : nullptr) : &ahead_.back();
  if (before != nullptr) {
    const auto valid = [](const Entry& e) { return e.sample.odometry.validity != Validity::kInvalid; };
    now.way = before->way;
    now.rise = before->rise;
    now.corrected = before->corrected;
    now.joined = valid(*before) && valid(now) && before->sample.channel == sample.channel &&
                 before->sample.reset_counter == sample.reset_counter &&
                 seconds_between(before->view.t_us, now.view.t_us) < kLongestGap;
    if (now.joined) {
      const VelocityMotion m = motion_by_velocity(before->view, now.view);
      now.way = after_motion(before->way, m.way);
      now.rise += m.rise;
      now.corrected += difference_of(now.view.pose, after_motion(before->view.pose, m.way));
    }
  }
  ahead_.push_back(now);
}

void Lookahead::drop_until(int64_t t_us) {
  while (!ahead_.empty() && ahead_.front().view.t_us <= t_us) {
    last_ = ahead_.front();
    ahead_.pop_front();
  }
}

std::optional<int64_t> Lookahead::newest_us() const {
  if (!ahead_.empty()) return ahead_.back().view.t_us;
  if (last_) return last_->view.t_us;
  return std::nullopt;
}

std::optional<Lookahead::Ahead> Lookahead::from(int64_t t_us) const {
  if (ahead_.empty() || ahead_.back().view.t_us <= t_us) return std::nullopt;
  const Entry& newest = ahead_.back();
  Ahead a;
  a.channel = newest.sample.channel;
  a.newest = newest.sample.odometry;
  a.enu = newest.sample.enu;
  a.dt = seconds_between(t_us, newest.view.t_us);
  const bool joined = std::all_of(ahead_.begin(), ahead_.end(), [](const Entry& e) { return e.joined; });
  a.valid = last_ && joined;
  if (!a.valid) return a;
  // The fusion may stand between the last sample dropped and the first ahead.
  const Planar there = after_motion(last_->way, motion_ahead(last_->view, seconds_between(last_->view.t_us, t_us)));
  a.motion = motion_between(there, newest.way);
  a.rise = newest.rise - last_->rise - last_->view.velocity.z() * seconds_between(last_->view.t_us, t_us);
  a.correction = newest.corrected - last_->corrected;
  return a;
}

}  // namespace roadfix
