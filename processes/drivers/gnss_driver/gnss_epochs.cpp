#include "drivers/gnss_driver/gnss_epochs.h"

#include <utility>

#include "drivers/gnss_driver/fix_limits.h"

namespace roadfix {

namespace {
/// After so many epochs without it, a part is not waited for any more.
constexpr int kMissesAllowed = 3;
}  // namespace

GnssFix* GnssEpochs::part(int64_t key, Part part, int64_t read_utime) {
  const unsigned bit = 1U << part;
  if (key == key_ && !open_) {
    expected_ |= bit;
    missed_[part] = 0;
    return nullptr;
  }
  if (key != key_) {
    close();
    key_ = key;
    open_ = true;
    since_us_ = read_utime;
    parts_ = 0;
    fix_ = GnssFix{};
  }
  return &fix_;
}

void GnssEpochs::mark(Part part) {
  if (!open_) return;
  parts_ |= 1U << part;
  expected_ |= 1U << part;
  missed_[part] = 0;
  if ((parts_ & expected_) == expected_ && has(kPosition)) close();
}

void GnssEpochs::end(int64_t key) {
  if (key == key_) close();
}

void GnssEpochs::wait(int64_t read_utime) {
  if (open_ && read_utime - since_us_ >= kHold_us && has(kPosition)) close();
}

void GnssEpochs::close() {
  if (!open_) return;
  for (int i = 0; i < kParts; ++i) {
    const unsigned bit = 1U << i;
    if ((expected_ & bit) == 0 || (parts_ & bit) != 0) continue;
    if (++missed_[i] >= kMissesAllowed) expected_ &= ~bit;
  }
  if (has(kPosition)) {
    const FixLimits limits = limit_fix(fix_);
    refused_ += limits.refused;
    if (limits.publish) whole_.push_back(fix_);
  }
  open_ = false;
}

void GnssEpochs::reset() {
  open_ = false;
  key_ = -1;
}

std::vector<GnssFix> GnssEpochs::take() { return std::exchange(whole_, {}); }

}  // namespace roadfix
