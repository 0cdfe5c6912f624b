/// A pose carried on by a channel's motion, with honest growth: what is new in each step, and what the channel's
/// calibration has wrong in all of them (MODEL.md, section 6).
#pragma once

#include "fusion/pose_channel.h"

namespace roadfix {

class CarriedPose {
 public:
  void start(int64_t t_us, const Planar& pose, const Eigen::Matrix3d& P, double height, double height_variance);

  /// Goes on to the time of the newest sample of channel `by`. Another channel than before closes the account of that.
  void carry(FusionChannel by, const Channels& channels);
  /// Goes on to t_us by a motion that no channel gave.
  void carry(int64_t t_us, const MotionStep& step, const Channels& channels);

  [[nodiscard]] int64_t t_us() const { return t_us_; }
  [[nodiscard]] Planar pose() const { return after_motion(pose_, sum_.motion); }
  [[nodiscard]] Eigen::Matrix3d covariance(const Channels& channels) const;
  [[nodiscard]] double height() const { return height_ + sum_.rise; }
  [[nodiscard]] double height_variance() const;

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.t_us_, self.pose_, self.P_, self.height_, self.height_variance_, self.sum_, self.way_, self.by_);
  }

 private:
  void close(const Channels& channels);
  void add(int64_t t_us, const MotionStep& step);

  int64_t t_us_ = 0;
  Planar pose_ = Planar::Zero();  ///< where sum_ begins
  Eigen::Matrix3d P_ = Eigen::Matrix3d::Zero();
  double height_ = 0.0, height_variance_ = 0.0;
  MotionStep sum_;
  double way_ = 0.0;                        ///< m, of sum_
  FusionChannel by_ = FusionChannel::kIns;  ///< whose calibration sum_ depends on
};

}  // namespace roadfix
