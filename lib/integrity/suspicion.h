/// Whether positions are under suspicion, and the pose from before that, which what comes is held against:
/// lib/integrity/MODEL.md, (P.5.n).
#pragma once

#include <cstdint>
#include <optional>

#include "integrity/separation.h"

namespace roadfix {

class Suspicion {
 public:
  /// There are no positions: what comes back is held against now.
  void begin_outage(const Anchor& now);
  /// Something contradicts positions at `now`, which may have been wrong since `before`.
  void contradict(const Anchor& before, const Anchor& now);
  /// What feeds this estimate is contradicted since t_us, when it was at `before`.
  void inherit(int64_t t_us, const Anchor& before, const Anchor& now);
  void end() { anchor_.reset(); }

  [[nodiscard]] bool raised() const { return anchor_.has_value(); }
  /// It is an outage's, not a contradiction's.
  [[nodiscard]] bool of_outage() const { return anchor_ && of_outage_; }
  [[nodiscard]] bool of_contradiction() const { return anchor_ && !of_outage_; }
  [[nodiscard]] const Anchor& anchor() const { return *anchor_; }
  /// s since the last reason for it.
  [[nodiscard]] double quiet_for(int64_t t_us) const { return seconds_between(failed_us_, t_us); }

  template <class Self, class Archive>
  static void archive(Self& self, Archive& a) {
    Anchor::archive_optional(self.anchor_, a);
    a(self.of_outage_, self.failed_us_);
  }

 private:
  std::optional<Anchor> anchor_;
  bool of_outage_ = false;
  int64_t failed_us_ = 0;
};

}  // namespace roadfix
