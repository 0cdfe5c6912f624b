/// What the raw IMU samples alone tell: their white noise as it is now, and whether the car may be standing.
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/ins_core.h"
#include "samples/samples.h"

namespace roadfix {

/// Means over one block of samples and what they say.
struct ImuBlock {
  int64_t end_us = 0;
  double duration = 0.0;                            ///< s
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, mean
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s2, mean
  double gyro_wander = 0.0;                         ///< rad/s, largest distance of a quarter's mean from the block's
  double accel_wander = 0.0;                        ///< m/s2, likewise
};

class ImuMonitor {
 public:
  explicit ImuMonitor(const GnssInsConfig& config);

  /// Returns true when this sample completes a block.
  bool add(const ImuSample& imu, double dt);

  /// (M.17): from second differences, which a car's motion hardly reaches and white noise fills.
  [[nodiscard]] ImuNoise noise() const;
  [[nodiscard]] const ImuBlock& block() const { return block_; }
  /// Identical readings for longer than a sensor with noise can give.
  [[nodiscard]] bool frozen() const { return repeats_ >= kFrozenSamples; }

  template <class Archive>
  void serialise(Archive& a);

 private:
  static constexpr int kQuarters = 4;
  static constexpr int kFrozenSamples = 20;
  void finish_block(int64_t t_us);

  double spec_gyro_, spec_accel_, factor_, block_s_;
  ImuSample one_, two_;  // the last two samples
  int count_ = 0, repeats_ = 0;
  double gyro_variance_ = 0.0, accel_variance_ = 0.0, dt_ = 0.0;
  Eigen::Matrix<double, 6, kQuarters> sums_ = Eigen::Matrix<double, 6, kQuarters>::Zero();
  Eigen::Vector4d times_ = Eigen::Vector4d::Zero();
  ImuBlock block_;
};

template <class Archive>
void ImuMonitor::serialise(Archive& a) {
  a(one_.t_us, one_.gyro, one_.accel, two_.t_us, two_.gyro, two_.accel, count_, repeats_, gyro_variance_,
    accel_variance_, dt_, sums_, times_, block_.end_us, block_.duration, block_.gyro, block_.accel, block_.gyro_wander,
    block_.accel_wander);
}

}  // namespace roadfix
