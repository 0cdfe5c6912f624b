/// Heading from nothing: one filter per heading around the circle, all fed alike, weighed by how well they predict
/// what comes in (a Gaussian sum as PX4's EKFGSF_yaw, but of whole filters, so that the winner needs no second start).
#pragma once

#include <optional>
#include <stdexcept>
#include <vector>

#include "gnss_ins/ins_core.h"
#include "gnss_ins/ins_memory.h"

namespace roadfix {

/// What is known at the start, without the heading.
struct StartState {
  int64_t t_us = 0;
  bool standing = false;
  Eigen::Vector3d mean_gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_accel = Eigen::Vector3d::Zero();
  double accel_std = 1.0;                             ///< m/s2, how far the mean may be from gravity
  Eigen::Vector3d antenna = Eigen::Vector3d::Zero();  ///< m, enu
  Eigen::Matrix3d antenna_cov = Eigen::Matrix3d::Identity();
  FixType fix_type = FixType::kNone;                    ///< of the fix in it,
  Eigen::Vector3d returning = Eigen::Vector3d::Zero();  ///< m, by which the fix may be displaced, enu: (M.37)
  LastingShare lasting;                                 ///< what of that fix lasts,
  Eigen::Matrix3d fix_cov = Eigen::Matrix3d::Zero();    ///< and its covariance, m2
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   ///< m/s, enu
  double velocity_std = 1.0;
  std::optional<double> yaw;  ///< rad, vehicle, where a sensor gives it
  double yaw_std = 0.0;
  std::optional<InsMemory> memory;   ///< of the last drive
  std::optional<double> parked_yaw;  ///< rad, imu, where the car seems to stand as it was parked
};

class HeadingBank {
 public:
  explicit HeadingBank(const GnssInsConfig& config) : config_(config) {}

  void start(const Geodetic& anchor, const StartState& start);
  void predict(const ImuSample& imu, double dt, const ImuNoise& noise);

  /// Every hypothesis tries aid(core); weights follow. Returns the leader's record.
  template <class Aid>
  AidingRecord aid(const Aid& aid_one) {
    AidingRecord leading;
    for (size_t i = 0; i < cores_.size(); ++i) {
      const AidingRecord r = aid_one(cores_[i]);
      if (i == leader_) leading = r;
      weigh(i, r);
    }
    normalise();
    return leading;
  }

  [[nodiscard]] bool started() const { return !cores_.empty(); }
  [[nodiscard]] InsCore& leader() { return cores_[leader_]; }
  [[nodiscard]] const InsCore& leader() const { return cores_[leader_]; }
  /// True when one heading is left and known well.
  [[nodiscard]] bool confirmed() const;
  /// rad, of all hypotheses about the leader's heading, as likely as each is.
  [[nodiscard]] double heading_std() const;
  /// Second moment of the error of the leader's state under all hypotheses: a sum of Gaussians has its own spread and
  /// that of its means.
  [[nodiscard]] ErrorMatrix covariance() const;
  void stop() { cores_.clear(); }

  /// `anchor` makes the filters that a reader fills.
  template <class Archive>
  void serialise(Archive& a, const Geodetic& anchor) {
    auto size = static_cast<int64_t>(cores_.size());
    a(size);
    if (size < 0 || size > 1000) throw std::runtime_error("state: impossible number of headings");
    while (static_cast<int64_t>(cores_.size()) < size) {
      cores_.emplace_back(config_, anchor);
      log_weights_.push_back(0.0);
    }
    for (size_t i = 0; i < cores_.size(); ++i) {
      cores_[i].serialise(a);
      a(log_weights_[i]);
    }
    a(leader_);
  }

 private:
  void add_hypothesis(const Geodetic& anchor, const StartState& start, double yaw, double yaw_std, double weight);
  void weigh(size_t i, const AidingRecord& r);
  /// Log weight of hypothesis i, with how likely a car drives as it says: forwards, unless it is slow.
  [[nodiscard]] double belief(size_t i) const;
  /// Share of hypothesis i, not normalised.
  [[nodiscard]] double share(size_t i) const;
  void normalise();

  GnssInsConfig config_;
  std::vector<InsCore> cores_;
  std::vector<double> log_weights_;
  size_t leader_ = 0;
};

}  // namespace roadfix
