/// Solution separation: the way of an estimate since an earlier pose of its own (the anchor) against the way by dead
/// reckoning, lib/integrity/MODEL.md (P.4.n). What is constant between the two (wheel scale, mounting) is learnt while
/// nothing contradicts. The witness's frame is its own; only its ways and turns count.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>

#include "integrity/error_scale.h"
#include "integrity/integrity_config.h"
#include "samples/samples.h"

namespace roadfix {

/// A pose of the estimate and the ways until then.
struct Anchor {
  int64_t t_us = 0;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();        ///< m, the estimate
  double yaw = 0.0;                                   ///< rad
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();      ///< m2, of p, vehicle axes
  double yaw_variance = 0.0;                          ///< rad2
  Eigen::Vector3d witness = Eigen::Vector3d::Zero();  ///< m, in the witness's frame
  double witness_yaw = 0.0;                           ///< rad
  int64_t witness_track = -1;                         ///< which unbroken track of the witness; -1: none
  Eigen::Vector3d own = Eigen::Vector3d::Zero();      ///< m, the estimate's velocity summed up
  double way = 0.0;                                   ///< m, driven
  double forward = 0.0;                               ///< m, driven forward less driven in reverse
  double bend = 0.0;                                  ///< m2/s2, lateral acceleration times way, summed up

  template <class Self, class Archive>
  static void archive(Self& s, Archive& a) {
    a(s.t_us, s.p, s.yaw, s.cov, s.yaw_variance, s.witness, s.witness_yaw, s.witness_track, s.own, s.way, s.forward,
      s.bend);
  }
  /// `Optional`: std::optional<Anchor> or a const one.
  template <class Optional, class Archive>
  static void archive_optional(Optional& anchor, Archive& a) {
    Anchor value = anchor.value_or(Anchor{});
    bool known = anchor.has_value();
    a(known);
    archive(value, a);
    if constexpr (Archive::kReads) anchor = known ? Optional(value) : Optional();
  }
};

/// Axes along, across, up of the vehicle now.
struct Separation {
  Eigen::Vector3d d = Eigen::Vector3d::Zero();      ///< m, estimate minus dead reckoning
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();  ///< m, of d where nothing has failed
  Eigen::Vector3d way = Eigen::Vector3d::Zero();    ///< m, dead reckoned
  bool witnessed = false;                           ///< by something else than the estimate's own velocity
};

class SeparationMonitor {
 public:
  explicit SeparationMonitor(const IntegrityConfig& config);

  /// The newest pose of the witness; `jumps` differs where it began anew.
  void add_witness(const Odometry& pose, int64_t jumps);

  /// Of the newest position that the estimate used: what nothing but the receiver would show ends with its positions.
  void set_position_time(int64_t t_us) { position_us_ = t_us; }

  /// Takes the estimate's newest pose; the separations below are at it.
  void step(const Odometry& estimate);

  /// Whether a separation over the short or the long lag is larger than learnt, (P.4.7).
  [[nodiscard]] bool contradicted() const;
  /// Learns from the newest separations, (P.4.5), (P.4.6): for the caller to call while nothing contradicts.
  void learn();

  [[nodiscard]] const Anchor& now() const { return now_; }
  /// The last anchor so long ago or longer, the oldest otherwise; nothing where there is none.
  [[nodiscard]] std::optional<Anchor> before(double lag) const;
  [[nodiscard]] Separation since(const Anchor& anchor) const;
  /// Of a separation over about the short lag: exceeded by its magnitude with probability `risk`, sigmas.
  [[nodiscard]] double quantile(int axis, double risk) const;

  template <class Self, class Archive>
  static void archive(Self& self, Archive& a) {
    auto& w = self.witness_;
    a(w.t_us, w.p, w.yaw, w.velocity, w.jumps, w.track);
    Anchor::archive(self.now_, a);
    a(self.position_us_, self.started_, self.step_, self.velocity_, self.R_vehicle_frame_);
    auto count = static_cast<int64_t>(self.anchors_.size());
    a(count);
    if constexpr (Archive::kReads) self.anchors_.resize(static_cast<std::size_t>(count));
    for (auto& anchor : self.anchors_) Anchor::archive(anchor, a);
    for (auto& ratio : self.ratio_) a(ratio.mean, ratio.cov);
    for (auto& of_lag : self.scale_)
      for (auto& scale : of_lag) ErrorScale::archive(scale, a);
  }

 private:
  struct Witness {
    int64_t t_us = 0;
    Eigen::Vector3d p = Eigen::Vector3d::Zero();         ///< m, its frame
    double yaw = 0.0;                                    ///< rad
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, its frame
    int64_t jumps = 0;
    int64_t track = -1;  ///< unbroken since; -1: none
  };
  /// What the witness's ways are off by: per way, per lateral acceleration times way, per way times half the lag.
  struct Ratio {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  };
  [[nodiscard]] Eigen::Vector3d ways_since(const Anchor& anchor, int axis, const Eigen::Vector3d& way) const;
  struct Coupled {
    Eigen::Vector3d mean, variance;  ///< m, m2
  };
  [[nodiscard]] Coupled coupling(const Eigen::Vector3d& way) const;
  /// s, for which the receiver may have drifted since, (P.4.9).
  [[nodiscard]] double unwitnessed_time(const Anchor& anchor) const;
  /// The separation over one of the two lags, and the way that it is over.
  struct Lagged {
    Separation separation;
    std::array<Eigen::Vector3d, 3> ways;  ///< by axis: m; m2/s2; m s
    double lag = 0.0;
  };
  [[nodiscard]] std::optional<Lagged> lagged(std::size_t lag) const;

  IntegrityConfig config_;
  Witness witness_;
  Anchor now_;
  std::optional<int64_t> position_us_;
  bool started_ = false;
  double step_ = 0.0;                                              ///< s, between the last two poses
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();             ///< m/s, the estimate's, in its frame
  Eigen::Matrix3d R_vehicle_frame_ = Eigen::Matrix3d::Identity();  ///< of the estimate now
  std::deque<Anchor> anchors_;                                     ///< one a second
  std::array<Ratio, 3> ratio_;
  std::array<std::array<ErrorScale, 3>, 2> scale_;  ///< by lag and axis
};

}  // namespace roadfix
