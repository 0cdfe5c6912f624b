#include "fusion/carried_pose.h"

#include <cmath>

namespace roadfix {
namespace {

constexpr double kHeightShare = 0.01;  ///< of the way: what a height loses by it
constexpr double kHeightFloor = 0.01;  ///< m per sqrt(s)

std::size_t at(FusionChannel c) { return static_cast<std::size_t>(c); }

}  // namespace

void CarriedPose::start(int64_t t_us, const Planar& pose, const Eigen::Matrix3d& P, double height,
                        double height_variance) {
  t_us_ = t_us;
  pose_ = pose;
  P_ = P;
  height_ = height;
  height_variance_ = height_variance;
  sum_ = {};
  way_ = 0.0;
}

void CarriedPose::close(const Channels& channels) {
  P_ = covariance(channels);
  pose_ = pose();
  height_variance_ = height_variance();
  height_ += sum_.rise;
  sum_ = {};
  way_ = 0.0;
}

void CarriedPose::add(int64_t t_us, const MotionStep& step) {
  sum_.add(step);
  way_ += step.motion.head<2>().norm();
  t_us_ = t_us;
}

void CarriedPose::carry(FusionChannel by, const Channels& channels) {
  const PoseChannel& channel = channels[at(by)];
  if (channel.t_us() <= t_us_) return;
  if (by != by_ && sum_.dt > 0.0) close(channels);
  by_ = by;
  add(channel.t_us(), channel.step(t_us_));
}

void CarriedPose::carry(int64_t t_us, const MotionStep& step, const Channels& channels) {
  if (t_us <= t_us_) return;
  close(channels);
  add(t_us, step);
}

Eigen::Matrix3d CarriedPose::covariance(const Channels& channels) const {
  return moved_covariance(moved_by(pose_, sum_.motion), P_,
                          sum_.covariance(channels[at(by_)].calibration().covariance()));
}

double CarriedPose::height_variance() const {
  const double sigma = kHeightShare * way_;
  return height_variance_ + kHeightFloor * kHeightFloor * sum_.dt + sigma * sigma;
}

}  // namespace roadfix
