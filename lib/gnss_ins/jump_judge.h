/// Who is wrong when positions are refused? A receiver that jumps keeps its new offset from a filter that is right; a
/// filter that is wrong moves away from the receiver.
#pragma once

#include <cmath>

#include "gnss_ins/measurement.h"

namespace roadfix {

class JumpJudge {
 public:
  /// True while all refused positions since the last accepted one lie where the first of them lay, within `sigmas`.
  bool judge(const AidingRecord& r, double sigmas) {
    if (r.status != AidingStatus::kGated) {
      refused_ = 0;
      cosines_ = 0.0;
      return false;
    }
    const Eigen::Vector3d off(r.innovation[0], r.innovation[1], r.innovation[2]);
    if (refused_ > 0) cosines_ += off.normalized().dot(last_);
    last_ = off.normalized();
    if (refused_++ == 0) {
      first_ = off;
      steady_ = true;
    }
    for (int i = 0; i < 3; ++i)
      if (std::abs(off(i) - first_(i)) > sigmas * std::sqrt(r.innovation_variance[static_cast<size_t>(i)]))
        steady_ = false;
    return steady_;
  }

  /// True while the refused positions lie all on one side: displaced, not noisy.
  [[nodiscard]] bool one_sided() const { return refused_ > 1 && cosines_ > kOneSide * (refused_ - 1); }

  template <class Archive>
  void serialise(Archive& a) {
    a(refused_, steady_, first_, cosines_, last_);
  }

 private:
  static constexpr double kOneSide = 0.8;  // mean cosine between successive ones; of noise it is zero

  int refused_ = 0;
  double cosines_ = 0.0;
  Eigen::Vector3d last_ = Eigen::Vector3d::Zero();  // direction
  bool steady_ = false;
  Eigen::Vector3d first_ = Eigen::Vector3d::Zero();
};

}  // namespace roadfix
