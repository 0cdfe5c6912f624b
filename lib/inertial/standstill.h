/// The one standstill test on inertial samples: blocks of half a second whose quarters agree, (I.4.1).
#pragma once

#include "inertial/imu_noise.h"

namespace roadfix::inertial {

/// Means over one block of samples.
struct ImuBlock {
  int64_t end_us = 0;
  double duration = 0.0;                            ///< s
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, mean
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s2, mean
  double gyro_spread = 0.0;                         ///< rad/s, largest distance of a quarter's mean from the block's
  double accel_spread = 0.0;                        ///< m/s2, likewise

  /// No more than a hand or a rough engine: at rest only where something else says so too.
  [[nodiscard]] bool quiet() const { return duration > 0.0 && gyro_spread < 0.03 && accel_spread < 0.36; }
};

class StandstillDetector {
 public:
  static constexpr double kBlock = 0.5;  ///< s

  /// True when this sample completes a block. `noise`: white noise as it is now; `frozen` readings are never calm.
  bool add(const ImuSample& imu, double dt, const ImuNoise& noise, bool frozen);

  [[nodiscard]] const ImuBlock& block() const { return block_; }
  /// The last block shows no more than noise and an idling engine.
  [[nodiscard]] bool calm() const { return calm_blocks_ > 0; }
  [[nodiscard]] int calm_blocks() const { return calm_blocks_; }  ///< in a row

  template <class Archive>
  void serialise(Archive& a) {
    a(sums_, times_, block_.end_us, block_.duration, block_.gyro, block_.accel, block_.gyro_spread, block_.accel_spread,
      calm_blocks_);
  }

 private:
  static constexpr int kQuarters = 4;
  void finish_block(int64_t t_us, const ImuNoise& noise, bool frozen);

  Eigen::Matrix<double, 6, kQuarters> sums_ = Eigen::Matrix<double, 6, kQuarters>::Zero();
  Eigen::Vector4d times_ = Eigen::Vector4d::Zero();
  ImuBlock block_;
  int calm_blocks_ = 0;
};

}  // namespace roadfix::inertial
