#include "navigation/aiding/gnss_position/rejected_run.h"

#include "samples/samples.h"

namespace roadfix::navigation {

namespace {

constexpr double kAlikeShare = 0.2;  // of their size, by which fixes of a run may differ
constexpr int kRun = 3;              // fewer are single outliers

}  // namespace

RejectedRun::Next RejectedRun::add(int64_t t_us, const Eigen::Vector3d& off, double noise) {
  if (rejected_++ == 0) since_us_ = t_us;
  newest_off_ = off;
  const double apart = (off - first_off_).head<2>().norm();
  if (agreeing_ > 0 && apart <= noise + kAlikeShare * off.head<2>().norm()) {
    ++agreeing_;
    return Next::kAgrees;
  }
  const Next next = agreeing_ == 0 ? Next::kFirst : Next::kDiffers;
  agreeing_ = 1;
  first_off_ = off;
  return next;
}

void RejectedRun::end(int64_t t_us, bool over) {
  if (over && rejected_ >= kRun) over_us_ = t_us;
  clear();
}

bool RejectedRun::over_within(int64_t t_us, double seconds) const {
  return over_us_ != 0 && seconds_between(over_us_, t_us) < seconds;
}

}  // namespace roadfix::navigation
