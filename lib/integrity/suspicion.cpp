#include "integrity/suspicion.h"

namespace roadfix {

void Suspicion::begin_outage(const Anchor& now) {
  failed_us_ = now.t_us;
  if (of_contradiction()) return;
  anchor_ = now;
  of_outage_ = true;
}

void Suspicion::contradict(const Anchor& before, const Anchor& now) {
  failed_us_ = now.t_us;
  if (!anchor_) anchor_ = before;
  of_outage_ = false;
}

void Suspicion::inherit(int64_t t_us, const Anchor& before, const Anchor& now) {
  failed_us_ = now.t_us;
  of_outage_ = false;
  if (!anchor_ || anchor_->t_us > t_us) anchor_ = before;
}

}  // namespace roadfix
