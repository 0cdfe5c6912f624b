/// When and with what noise a GNSS position is used: the one error model of a receiver, (N.5) of MODEL.md.
///
/// A position is h + b + n: n white with an adaptive scale, b a Gauss-Markov state whose share of the variance and time
/// are those that explain the fixes best against the way driven. What the gate rejects is a single outlier, a displaced
/// receiver or a wrong filter: runs of rejected fixes that agree with each other are decided by the likelihoods of the
/// last two under heavy-tailed priors, and b or the filter is widened by what they differ.
#pragma once

#include <array>

#include "navigation/aiding/gates.h"
#include "navigation/aiding/gnss_position/lasting_error.h"
#include "navigation/aiding/gnss_position/rejected_run.h"
#include "navigation/aiding/noise_scale.h"
#include "navigation/measurement_queue.h"
#include "navigation/serialise_optional.h"

namespace roadfix::navigation {

class GnssPositionControl {
 public:
  explicit GnssPositionControl(const NavigationConfig& config);

  /// `status` kReset: the filter was found wrong and took the fix.
  AidingRecord use(Filter& filter, const Queued& fix);
  /// A fix of this time has come, whatever becomes of it; use() and started_with() know.
  void see(int64_t t_us);
  /// For a hypothesis of the start: no gate, no learning.
  AidingRecord try_on(Filter& filter, const Queued& fix) const;
  /// A fix was tried on the hypotheses of a start, or made them.
  void tried(const Queued& fix) { note_start(fix.t_us, fix.fix_type); }
  void started_with(const GnssFix& fix) { note_start(fix.t_us, fix.fix_type); }
  /// m, level axes: of the Gauss-Markov error in a fix, and of what it may have brought back from an outage.
  [[nodiscard]] Eigen::Vector3d lasting_std(const GnssFix& fix) const;
  [[nodiscard]] Eigen::Vector3d return_std(const GnssFix& fix) const;

  /// The step detector found that the receiver is displaced.
  void set_displaced(int64_t t_us) {
    displaced_since_us_ = t_us;
    back_ = 0.0;
  }
  [[nodiscard]] bool displaced() const { return displaced_since_us_ != 0; }
  /// The newest fixes were rejected.
  [[nodiscard]] bool rejects() const { return !run_.empty(); }
  /// They have not been for long, or a run of them was until lately: how the receiver is wrong may show yet. After an outage
  /// use() decides.
  [[nodiscard]] bool waits(int64_t t_us) const;
  /// The receiver of the rejected fixes is displaced, by what the newest is off.
  void displace(Filter& filter);
  /// The height alone is displaced.
  [[nodiscard]] bool height_displaced() const { return height_displaced_; }
  /// The filter has a gap in its past: nothing holds against the receiver.
  void clear_run() {
    run_.clear();
    forget_way();
  }
  /// The way driven is broken (a gap, a step that was taken back): older fixes are not compared with newer ones.
  void forget_way() {
    for (Receiver& r : receivers_) r.lasting.begin_anew();
  }
  /// The filter starts anew: what contradicted the receiver is gone.
  void restart() {
    clear_run();
    displaced_since_us_ = 0;
    height_displaced_ = false;
  }

  template <class Archive>
  void serialise(Archive& a) {
    for (Receiver& r : receivers_) {
      r.scale.serialise(a);
      r.lasting.serialise(a);
    }
    a(used_at_us_, seen_at_us_, outage_, last_type_, share_, displaced_since_us_, back_, height_displaced_);
    run_.serialise(a);
  }

 private:
  /// What fixes of one type have shown.
  struct Receiver {
    NoiseScale scale;
    LastingErrorModels lasting{{5.0, 15.0, 50.0}, 0.9};  // s: multipath and code smoothing (Misra and Enge 2006, ch. 5)
  };
  /// What of the receiver's Gauss-Markov error a fix begins with.
  struct Bias {
    LastingError like;
    bool anew = false;     ///< another type, or after an outage: what b holds is over
    bool returns = false;  ///< from an outage, perhaps displaced
    Eigen::Vector3d std;   ///< m, stationary

    [[nodiscard]] Bias begun() const { return {like, false, false, std}; }
  };

  [[nodiscard]] const Receiver& receiver(FixType type) const { return receivers_[static_cast<size_t>(type)]; }
  void note(int64_t t_us, FixType type) {
    used_at_us_ = seen_at_us_ = t_us;
    outage_ = false;
    last_type_ = type;
  }
  void note_start(int64_t t_us, FixType type) {
    see(t_us);
    note(t_us, type);
    share_ = lasting(type).share;
  }
  /// Rejected ones are no outage.
  [[nodiscard]] bool after_outage(int64_t t_us) const;
  [[nodiscard]] bool returns(int64_t t_us, FixType type) const;
  [[nodiscard]] Bias bias_of(const Queued& fix) const;
  [[nodiscard]] Measurement<3> measurement(const Filter& filter, const Queued& fix, const Bias& bias) const;
  [[nodiscard]] LastingError lasting(FixType type) const;
  /// Of the errors, over the claimed variance; at least one.
  [[nodiscard]] double variance_factor(FixType type) const;
  void set_noise(Filter& filter, const Bias& bias) const;
  void set_bias(Filter& filter, const Bias& bias);
  void begin(Filter& filter, const Bias& bias) const;
  void watch(const Filter& filter, const Queued& fix, const Bias& bias, const Eigen::Vector2d& before);
  /// A code receiver without an imu beside it: nothing but other fixes could show an outlier.
  [[nodiscard]] bool heavy_tailed(FixType type) const {
    return !config_.facts.has_imu && type != FixType::kRtkFixed && type != FixType::kRtkFloat;
  }
  AidingRecord use_heavy_tailed(Filter& filter, const Queued& fix, const Bias& bias);
  AidingRecord use_level(Filter& filter, const Queued& fix, const Bias& bias);
  AidingRecord decide(Filter& filter, const Queued& fix, const Bias& bias, const AidingRecord& rejected);
  [[nodiscard]] bool jumped_back(const Filter& filter, const Queued& fix, const Bias& bias) const;
  bool is_back(Filter& filter, const Queued& fix, const Bias& bias, double log_likelihood);
  AidingRecord believe(Filter& filter, const Queued& fix, const Bias& bias);
  void widen_filter(Filter& filter, const Queued& fix, const Eigen::Vector3d& off) const;
  void learn(const Queued& fix, const AidingRecord& r);

  NavigationConfig config_;
  Gates gates_, open_;
  std::array<Receiver, 6> receivers_;  // by FixType
  int64_t used_at_us_ = 0;             // or tried on the hypotheses of a start
  int64_t seen_at_us_ = 0;             // used or not
  bool outage_ = false;                // before one that has been seen, and none has been used since
  FixType last_type_ = FixType::kNone;
  double share_ = 0.0;  // of the variance, that b has been taken to have
  RejectedRun run_;
  int64_t displaced_since_us_ = 0;
  double back_ = 0.0;  // logarithm of the odds that it is no longer displaced
  bool height_displaced_ = false;
};

}  // namespace roadfix::navigation
