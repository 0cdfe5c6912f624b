#include "fusion/channel_track.h"

#include <algorithm>

namespace roadfix {
namespace {

constexpr double kRecent = 0.8;  ///< s

}  // namespace

void ChannelTrack::begin_segment() {
  ++segment_;
  recent_.clear();
}

void ChannelTrack::add(const Planar& way, double rise) {
  sum_.way = after_motion(sum_.way, way);
  sum_.rise += rise;
}

void ChannelTrack::reach(int64_t t_us) {
  while (!recent_.empty() && seconds_between(recent_.front().t_us, t_us) > kRecent) recent_.pop_front();
  sum_.t_us = t_us;
  recent_.push_back(sum_);
}

ChannelTrack::Point ChannelTrack::at(int64_t t_us, const LevelView& newest) const {
  if (recent_.empty() || t_us >= recent_.back().t_us) {
    const double ahead = seconds_between(newest.t_us, t_us);
    return {t_us, after_motion(sum_.way, motion_ahead(newest, ahead)), sum_.rise + ahead * newest.velocity.z()};
  }
  const auto after = std::upper_bound(recent_.begin(), recent_.end(), t_us,
                                      [](int64_t t, const Point& point) { return t < point.t_us; });
  if (after == recent_.begin()) return *after;
  const Point& before = *std::prev(after);
  const double share = seconds_between(before.t_us, t_us) / seconds_between(before.t_us, after->t_us);
  return {t_us, after_motion(before.way, share * motion_between(before.way, after->way)),
          before.rise + share * (after->rise - before.rise)};
}

}  // namespace roadfix
