/// Whether the heading that a filter began with holds: a car seldom drives backwards, and a remembered heading has no past to
/// hold against a receiver that contradicts it, (N.7.4) of MODEL.md.
#pragma once

#include "navigation/state.h"

namespace roadfix::navigation {

class StartMonitor {
 public:
  /// `agreed`: nothing was remembered that fixes had to agree with.
  void begin(const Mean& x, int64_t t_us, bool agreed);
  /// A fix was used; `displaced`: its receiver is.
  void see_fix(const Mean& x, bool displaced);
  /// Once a sample. `excused`: wheels agree, or nobody claims to know the heading.
  [[nodiscard]] bool heads_backwards(const Mean& x, bool excused);
  /// Fixes have agreed over some way.
  [[nodiscard]] bool agreed() const { return agreed_; }

  template <class Archive>
  void serialise(Archive& a) {
    a(backwards_since_us_, agreed_, began_at_);
  }

 private:
  int64_t backwards_since_us_ = 0;  ///< faster than a car goes in reverse
  bool agreed_ = true;
  Eigen::Vector3d began_at_ = Eigen::Vector3d::Zero();  ///< m, level
};

}  // namespace roadfix::navigation
