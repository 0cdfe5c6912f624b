/// One source of poses as the fusion sees it: its motion step by step, whether it lives, and how far its motion can be
/// relied on (MODEL.md, section 4).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "fusion/channel_calibration.h"
#include "fusion/channel_errors.h"
#include "fusion/channel_health.h"
#include "fusion/channel_track.h"
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
  /// A measured motion of dt seconds, corrected, with its noise.
  [[nodiscard]] MotionStep corrected(const Planar& measured, double rise, double dt) const;
  [[nodiscard]] const ChannelTrack& track() const { return track_; }
  /// Sum of its motions as measured, at t_us.
  [[nodiscard]] Planar way(int64_t t_us) const { return track_.at(t_us, view_).way; }
  /// Its pose then, likewise.
  [[nodiscard]] Planar pose(int64_t t_us) const {
    return after_motion(view_.pose, motion_between(track_.way(), way(t_us)));
  }

  [[nodiscard]] bool alive(int64_t t_us) const { return has_pose_ && since(t_us) < noise_.timeout; }
  [[nodiscard]] ChannelState state(int64_t t_us) const;
  [[nodiscard]] bool good(int64_t t_us) const { return state(t_us) == ChannelState::kGood; }
  /// Its motion is there to be compared, up to the unit of its lengths.
  [[nodiscard]] bool moves(int64_t t_us) const { return alive(t_us) && !health_.frozen(); }
  [[nodiscard]] const ChannelHealth& health() const { return health_; }
  [[nodiscard]] ChannelHealth& health() { return health_; }
  /// s for which it has repeated its pose.
  [[nodiscard]] double repeated(int64_t t_us) const { return seconds_between(repeated_since_us_, t_us); }
  [[nodiscard]] const ChannelErrors& errors() const { return errors_; }
  [[nodiscard]] ChannelErrors& errors() { return errors_; }
  /// m2: expected squared error of its motion over 10 s at this speed; the smaller, the better it leads.
  [[nodiscard]] double expected_error(double speed) const;
  [[nodiscard]] const ChannelCalibration& calibration() const { return calibration_; }
  [[nodiscard]] ChannelCalibration& calibration() { return calibration_; }
  /// Its lengths are metres, or known to be how many.
  [[nodiscard]] bool has_lengths() const;

  /// The newest sample with a pose.
  [[nodiscard]] const ChannelSample& newest() const { return newest_; }
  [[nodiscard]] const Odometry& odometry() const { return newest_.odometry; }
  [[nodiscard]] const LevelView& view() const { return view_; }
  [[nodiscard]] int64_t t_us() const { return view_.t_us; }
  [[nodiscard]] std::optional<int64_t> last_us() const { return ever_us_; }
  [[nodiscard]] double speed() const { return calibration_.length() * view_.velocity.x(); }
  /// By how much the last add()'s pose differs from its predecessor carried on by velocities, in its frame.
  [[nodiscard]] const Planar& correction() const { return correction_; }
  [[nodiscard]] const Eigen::Matrix3d& covariance_before() const { return P_before_; }

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.track_, self.health_, self.errors_, self.calibration_, self.newest_, self.has_pose_, self.view_,
          self.correction_, self.P_before_, self.ever_us_, self.repeated_since_us_);
  }

 private:
  [[nodiscard]] double since(int64_t t_us) const { return seconds_between(view_.t_us, t_us); }
  void begin_segment();
  void measure(const LevelView& now, const ChannelSample& sample, bool reset);
  [[nodiscard]] Eigen::Matrix3d step_noise(double dt) const;

  FusionChannel channel_;
  ChannelNoise noise_;
  ChannelTrack track_;
  ChannelHealth health_;
  ChannelErrors errors_;
  ChannelCalibration calibration_;
  ChannelSample newest_;  ///< with a pose; its reset counter that of any
  bool has_pose_ = false;
  LevelView view_;  ///< of newest_
  Planar correction_ = Planar::Zero();
  Eigen::Matrix3d P_before_ = Eigen::Matrix3d::Zero();
  std::optional<int64_t> ever_us_;
  int64_t repeated_since_us_ = 0;
};

using Channels = std::array<PoseChannel, kFusionChannels>;

}  // namespace roadfix
