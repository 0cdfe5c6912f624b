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
      return false;
    }
    const Eigen::Vector3d off(r.innovation[0], r.innovation[1], r.innovation[2]);
    if (refused_++ == 0) {
      first_ = off;
      steady_ = true;
    }
    for (int i = 0; i < 3; ++i)
      if (std::abs(off(i) - first_(i)) > sigmas * std::sqrt(r.innovation_variance[static_cast<size_t>(i)]))
        steady_ = false;
    return steady_;
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(refused_, steady_, first_);
  }

 private:
  int refused_ = 0;
  bool steady_ = false;
  Eigen::Vector3d first_ = Eigen::Vector3d::Zero();
};

}  // namespace roadfix
