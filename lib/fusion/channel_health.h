/// Whether a channel can be relied on: by its own validity, by whether it is frozen, and by the other channels (MODEL.md,
/// section 4).
#pragma once

#include <cstdint>

namespace roadfix {

enum class ChannelState {
  kSilent,        ///< no valid sample lately
  kInvalid,       ///< says so of its newest pose
  kFrozen,        ///< repeats one pose although the vehicle moves
  kOnTrial,       ///< began anew: has to agree with a witness before it counts
  kContradicted,  ///< by two witnesses, or by one that is relied on more
  kGood
};

class ChannelHealth {
 public:
  /// It began anew.
  void begin_trial() { trial_left_ = kTrial; }
  void set_invalid(bool invalid) { invalid_ = invalid; }
  void set_frozen(bool frozen) { frozen_ = frozen; }
  /// The outcome of one epoch: on trial, it agreed with a witness (or has none).
  void judge(bool contradicted, bool agreed) {
    contradicted_ = contradicted;
    if (trial_left_ > 0) trial_left_ = agreed && !contradicted ? trial_left_ - 1 : kTrial;
  }

  [[nodiscard]] bool frozen() const { return frozen_; }
  [[nodiscard]] bool on_trial() const { return trial_left_ > 0; }
  /// `speaks`: a sample came lately, `alive`: a valid one; `has_lengths`: its lengths are metres.
  [[nodiscard]] ChannelState state(bool speaks, bool alive, bool has_lengths) const {
    if (invalid_ && speaks) return ChannelState::kInvalid;
    if (!alive) return ChannelState::kSilent;
    if (frozen_) return ChannelState::kFrozen;
    if (contradicted_) return ChannelState::kContradicted;
    return on_trial() || !has_lengths ? ChannelState::kOnTrial : ChannelState::kGood;
  }

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.trial_left_, self.invalid_, self.frozen_, self.contradicted_);
  }

 private:
  static constexpr int kTrial = 4;  ///< epochs of agreement: 2 s

  int trial_left_ = 0;
  bool invalid_ = false, frozen_ = false, contradicted_ = false;
};

}  // namespace roadfix
