#include "fusion/outlook.h"

#include <algorithm>

#include "fusion/saved.h"

namespace roadfix {
namespace {

constexpr double kLongestGap = 0.5;  ///< s between two samples of one channel that tell the motion in between

}  // namespace

void Outlook::see(const ChannelSample& s) {
  const OutlookStep* before = !ahead_.empty() ? &ahead_.back() : last_ ? &*last_ : nullptr;
  if (before != nullptr && s.odometry.t_us <= before->t_us) return;
  OutlookStep step;
  step.t_us = s.odometry.t_us;
  step.channel = s.channel;
  step.metric = s.metric;
  step.known = s.odometry.validity != Validity::kInvalid && s.odometry.velocity.allFinite();
  step.felt = s.odometry;
  step.view = level_view(s.odometry);
  if (before != nullptr) {
    step.way = before->way;
    step.rise = before->rise;
    step.silent = before->silent;
    const double dt = seconds_between(before->t_us, step.t_us);
    if (before->known && step.known && before->channel == step.channel && dt < kLongestGap) {
      const FeltMotion m = motion_by_velocity(before->view, step.view);
      step.way = after_motion(step.way, m.way);
      step.correction = difference_of(step.view.pose, after_motion(before->view.pose, m.way));
      step.rise += m.rise;
    } else {
      step.silent += dt;
    }
  }
  ahead_.push_back(step);
}

void Outlook::drop_until(int64_t t_us) {
  while (!ahead_.empty() && ahead_.front().t_us <= t_us) {
    last_ = ahead_.front();
    ahead_.pop_front();
  }
}

Fusion::Poses Outlook::poses(const Fusion& fusion) const {
  if (ahead_.empty() || ahead_.back().t_us <= fusion.t_us()) return fusion.carried({});
  const OutlookStep& first = ahead_.front();
  const OutlookStep& newest = ahead_.back();
  Fusion::Ahead a;
  a.dt = seconds_between(fusion.t_us(), newest.t_us);
  a.channel = newest.channel;
  a.metric = newest.metric;
  // From the fusion's time to the first sample ahead: with that one's own velocities.
  const double to_first = std::max(0.0, seconds_between(fusion.t_us(), first.t_us));
  Planar way = Planar::Zero();
  if (first.known && to_first < kLongestGap) {
    LevelView begin = first.view;
    begin.t_us = fusion.t_us();
    const FeltMotion m = motion_by_velocity(begin, first.view);
    way = m.way;
    a.rise = m.rise;
  } else {
    a.silent = to_first;
  }
  a.way = after_motion(way, motion_between(first.way, newest.way));
  a.rise += newest.rise - first.rise;
  a.silent += newest.silent - first.silent;
  if (newest.known) a.felt = &newest.felt;
  a.view = newest.view;
  a.back = returned(fusion, fusion.follows(a));
  return fusion.carried(a);
}

/// What the published pose will have to make up at the newest sample: as it goes back by then, and the corrections on
/// the way as the fusion will take them. A jump is the fusion's alone, which counts it.
ReturnState Outlook::returned(const Fusion& fusion, bool follows) const {
  const ReturnConfig& config = fusion.config().comeback;
  ReturnState back = fusion.comeback();
  back.fixes_in_row = 0;
  int64_t t_us = fusion.t_us();
  for (const OutlookStep& step : ahead_) {
    let_return(back, config, std::max(0.0, seconds_between(t_us, step.t_us)));
    t_us = step.t_us;
    if (follows) take_fix(back, config, step.correction, false);
  }
  return back;
}

template <class Self, class Visitor>
void Outlook::visit_step(Self& step, const Visitor& visit) {
  visit(step.t_us, step.channel, step.metric, step.known, step.way, step.rise, step.silent);
  fusion::visit_odometry(step.felt, visit);
}

void Outlook::save(StateWriter& writer) const {
  const auto put = [&](const auto&... members) { (fusion::write(writer, members), ...); };
  put(last_.has_value());
  if (last_) visit_step(*last_, put);
}

void Outlook::load(StateReader& reader) {
  const auto get = [&](auto&... members) { (fusion::read(reader, members), ...); };
  ahead_.clear();
  last_.reset();
  if (!reader.get<bool>()) return;
  visit_step(last_.emplace(), get);
  last_->view = level_view(last_->felt);
}

}  // namespace roadfix
