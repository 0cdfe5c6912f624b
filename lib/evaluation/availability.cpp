#include "evaluation/availability.h"

#include <algorithm>

namespace roadfix {
namespace {

Presence presence_of(Validity validity) {
  switch (validity) {
    case Validity::kInvalid:
      return Presence::kInvalid;
    case Validity::kCoasting:
      return Presence::kCoasting;
    case Validity::kValid:
      return Presence::kValid;
  }
  return Presence::kInvalid;
}

/// Spans clipped to the time asked about, neighbours of one kind joined.
class Timeline {
 public:
  Timeline(int64_t begin_us, int64_t end_us) : begin_us_(begin_us), end_us_(end_us) {}

  void add(int64_t from_us, int64_t to_us, Presence presence) {
    const PresenceSpan span{std::max(from_us, begin_us_), std::min(to_us, end_us_), presence};
    if (span.end_us <= span.begin_us) return;
    if (!spans_.empty() && spans_.back().presence == presence) {
      spans_.back().end_us = span.end_us;
    } else {
      spans_.push_back(span);
    }
  }

  [[nodiscard]] std::vector<PresenceSpan> take() { return std::move(spans_); }

 private:
  int64_t begin_us_, end_us_;
  std::vector<PresenceSpan> spans_;
};

}  // namespace

Availability availability(const Trajectory& estimate, int64_t begin_us, int64_t end_us) {
  Availability out;
  if (end_us <= begin_us) return out;
  const int64_t hold_us = default_max_gap_us(estimate);
  Timeline timeline(begin_us, end_us);
  int64_t covered_us = begin_us;
  for (std::size_t i = 0; i < estimate.poses.size(); ++i) {
    const Odometry& pose = estimate.poses[i];
    const bool last = i + 1 == estimate.poses.size();
    const int64_t next_us = last ? end_us : estimate.poses[i + 1].t_us;
    timeline.add(covered_us, pose.t_us, Presence::kSilent);
    covered_us = std::min(next_us, pose.t_us + hold_us);
    timeline.add(pose.t_us, covered_us, presence_of(pose.validity));
  }
  timeline.add(covered_us, end_us, Presence::kSilent);
  out.spans = timeline.take();
  double* const share[] = {&out.silent, &out.invalid, &out.coasting, &out.valid};
  for (const PresenceSpan& span : out.spans) {
    *share[static_cast<int>(span.presence)] +=
        static_cast<double>(span.end_us - span.begin_us) / static_cast<double>(end_us - begin_us);
  }
  return out;
}

}  // namespace roadfix
