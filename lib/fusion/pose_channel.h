/// One source of poses as the fusion sees it: its motion step by step, whether it lives, and how far its motion can be
/// relied on (MODEL.md, section 4).
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>

#include "fusion/channel_calibration.h"
#include "fusion/fusion_config.h"
#include "stream/state_bytes.h"

namespace roadfix {

enum class FusionChannel { kIns = 0, kVo = 1, kWheel = 2 };
inline constexpr int kFusionChannels = 3;

struct ChannelSample {
  FusionChannel channel = FusionChannel::kIns;
  Odometry odometry;
  int reset_counter = 0;
  bool metric = true;              ///< false: lengths are up to a common factor
  bool enu = false;                ///< of an INS: its frame is ENU; otherwise its own
  bool lengths_of_wheels = false;  ///< of a vision: no second witness of the way's length beside the wheels
  bool by_velocity = false;        ///< of a filter, whose poses hold corrections: its velocities are its motion
  int64_t seq = 0;
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.channel, self.odometry, self.reset_counter, self.metric, self.enu, self.lengths_of_wheels,
          self.by_velocity, self.seq);
  }
};

/// Finite, and an attitude that is one.
bool usable(const Odometry& odometry);

enum class FuseStatus { kAccepted, kGated, kNotReady, kBadInput, kBadQuality, kReset, kDisabled };

enum class ChannelState {
  kSilent,        ///< no valid sample lately
  kInvalid,       ///< says so of its newest pose
  kFrozen,        ///< repeats one pose although the vehicle moves
  kOnTrial,       ///< began anew: has to agree with a witness before it counts
  kContradicted,  ///< by two witnesses, or by one that is relied on more
  kGood
};

class PoseChannel {
 public:
  PoseChannel(FusionChannel channel, const ChannelNoise& noise);

  /// Takes in a sample. Older ones, and what is no pose, are refused.
  FuseStatus add(const ChannelSample& sample);
  /// Its motion from `from_us` to its newest sample, corrected: by its velocity where track() does not reach back so far.
  [[nodiscard]] MotionStep step(int64_t from_us) const;
  /// Its motion between two times that track() knows.
  [[nodiscard]] MotionStep measured(int64_t from_us, int64_t to_us) const;
  /// A motion of dt seconds with its newest velocity, changed along by `change` (m/s).
  [[nodiscard]] MotionStep by_velocity(double dt, double change = 0.0) const;
  /// Sum of its motions as measured, at t_us: between its samples of the last second, or carried on by its velocity.
  [[nodiscard]] Planar track(int64_t t_us) const { return track_at(t_us).way; }
  /// Its pose then, likewise.
  [[nodiscard]] Planar pose(int64_t t_us) const {
    return after_motion(view_.pose, motion_between(track_.way, track(t_us)));
  }
  /// Whether track() reaches back to that time.
  [[nodiscard]] bool has_track(int64_t t_us) const { return !recent_.empty() && recent_.front().t_us <= t_us; }
  /// Tracks of one segment can be compared.
  [[nodiscard]] int segment() const { return segment_; }

  [[nodiscard]] bool alive(int64_t t_us) const { return last_ && since(t_us) < noise_.timeout; }
  [[nodiscard]] ChannelState state(int64_t t_us) const;
  [[nodiscard]] bool good(int64_t t_us) const { return state(t_us) == ChannelState::kGood; }
  /// Its motion is there to be compared, up to the unit of its lengths.
  [[nodiscard]] bool moves(int64_t t_us) const { return alive(t_us) && !frozen_; }
  [[nodiscard]] bool on_trial() const { return trial_left_ > 0; }

  /// The outcome of one epoch: on trial, it agreed with a witness (or has none).
  void judge(bool contradicted, bool agreed);
  void set_frozen(bool frozen) { frozen_ = frozen; }
  /// s for which it has repeated its pose.
  [[nodiscard]] double repeated(int64_t t_us) const;
  /// m2: expected squared error of its motion over 10 s at this speed; the smaller, the better it leads.
  [[nodiscard]] double expected_error(double speed) const;
  /// Covariance of what is new in a window's motion, start and end jitter included (F.5.2).
  [[nodiscard]] Eigen::Matrix3d window_noise(const Planar& motion, double dt) const;
  /// Compares its squared residual of a window with what is expected: sets the noise factors (F.4.4).
  void adapt(const Planar& residual, const Planar& motion, double dt, const Eigen::Matrix3d& reference);

  [[nodiscard]] const Odometry& odometry() const { return *last_; }
  [[nodiscard]] const LevelView& view() const { return view_; }
  [[nodiscard]] bool enu() const { return enu_; }
  [[nodiscard]] bool lengths_of_wheels() const { return lengths_of_wheels_; }
  [[nodiscard]] int64_t t_us() const { return view_.t_us; }
  [[nodiscard]] std::optional<int64_t> last_us() const { return ever_us_; }
  /// A measured motion of dt seconds, corrected, with its noise.
  [[nodiscard]] MotionStep corrected(const Planar& measured, double rise, double dt) const;
  [[nodiscard]] double speed() const { return calibration_.length() * view_.velocity.x(); }
  [[nodiscard]] const ChannelCalibration& calibration() const { return calibration_; }
  [[nodiscard]] ChannelCalibration& calibration() { return calibration_; }
  [[nodiscard]] const Eigen::Vector2d& noise_factors() const { return factors_; }
  [[nodiscard]] bool has_lengths() const;
  /// By how much the last add()'s pose differs from its predecessor carried on by velocities, in its frame.
  [[nodiscard]] const Planar& correction() const { return correction_; }
  [[nodiscard]] const Eigen::Matrix3d& covariance_before() const { return P_before_; }
  [[nodiscard]] int reset_counter() const { return reset_counter_; }

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.calibration_, self.last_, self.view_, self.track_, self.recent_, self.correction_, self.P_before_,
          self.factors_, self.ever_us_, self.repeated_since_us_, self.segment_, self.reset_counter_, self.trial_left_,
          self.yaw_growth_, self.metric_, self.enu_, self.lengths_of_wheels_, self.invalid_, self.frozen_,
          self.contradicted_, self.was_reset_);
  }

 private:
  [[nodiscard]] double since(int64_t t_us) const { return seconds_between(view_.t_us, t_us); }
  void begin_segment();
  void measure(const LevelView& now, double z, const ChannelSample& sample);
  [[nodiscard]] Eigen::Matrix3d step_noise(double dt) const;

  struct TrackPoint {
    int64_t t_us = 0;
    Planar way = Planar::Zero();
    double rise = 0.0;  ///< m
    template <class Self, class Visitor>
    static void visit_members(Self& self, const Visitor& visit) {
      visit(self.t_us, self.way, self.rise);
    }
  };
  [[nodiscard]] TrackPoint track_at(int64_t t_us) const;

  FusionChannel channel_;
  ChannelNoise noise_;
  ChannelCalibration calibration_;
  std::optional<Odometry> last_;
  LevelView view_;                 ///< of last_
  TrackPoint track_;               ///< sum of its measured motions
  std::deque<TrackPoint> recent_;  ///< oldest first
  Planar correction_ = Planar::Zero();
  Eigen::Matrix3d P_before_ = Eigen::Matrix3d::Zero();
  Eigen::Vector2d factors_ = Eigen::Vector2d::Ones();  ///< on the variances of place and yaw
  std::optional<int64_t> ever_us_;
  int64_t repeated_since_us_ = 0;
  int segment_ = 0;
  int reset_counter_ = 0;
  int trial_left_ = 0;
  double yaw_growth_ = 0.0;  ///< rad2/s, of the variance that it claims, from its last sample but one
  bool metric_ = true;
  bool enu_ = false;
  bool lengths_of_wheels_ = false;
  bool invalid_ = false;
  bool frozen_ = false;
  bool contradicted_ = false;
  bool was_reset_ = false;
};

using Channels = std::array<PoseChannel, kFusionChannels>;

}  // namespace roadfix
