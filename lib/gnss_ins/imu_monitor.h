/// What the raw IMU samples alone tell: their white noise as it is now, and whether the car may be standing.
#pragma once

#include <array>

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

/// White noise density seen through second differences of means over `length` samples. A second difference of white
/// noise has six times its variance; a car's motion hardly reaches it, a vibration does.
class NoiseBand {
 public:
  explicit NoiseBand(int length) : length_(length) {}
  void add(const ImuSample& imu, double dt);
  [[nodiscard]] ImuNoise density() const;
  [[nodiscard]] bool known() const { return means_ > 12; }

  template <class Archive>
  void serialise(Archive& a) {
    a(gyro_sum_, accel_sum_, time_, gyro_one_, gyro_two_, accel_one_, accel_two_, samples_, means_, gyro_, accel_);
  }

 private:
  int length_;
  Eigen::Vector3d gyro_sum_ = Eigen::Vector3d::Zero(), accel_sum_ = Eigen::Vector3d::Zero();
  double time_ = 0.0;
  Eigen::Vector3d gyro_one_ = Eigen::Vector3d::Zero(), gyro_two_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_one_ = Eigen::Vector3d::Zero(), accel_two_ = Eigen::Vector3d::Zero();
  int samples_ = 0, means_ = 0;
  double gyro_ = 0.0, accel_ = 0.0;  ///< densities squared
};

class ImuMonitor {
 public:
  explicit ImuMonitor(const GnssInsConfig& config);

  /// Returns true when this sample completes a block.
  bool add(const ImuSample& imu, double dt);

  /// (M.17): white noise shows alike in every band, a vibration in some and motion in the slow one; the quietest band
  /// therefore tells the white noise.
  [[nodiscard]] const ImuNoise& noise() const { return noise_; }
  [[nodiscard]] const ImuBlock& block() const { return block_; }
  /// The last block is calm enough to stand: no quarter differs from it by more than noise and engine shake give.
  [[nodiscard]] bool calm() const { return calm_blocks_ > 0; }
  /// So many blocks in a row were calm, (M.53).
  [[nodiscard]] int calm_blocks() const { return calm_blocks_; }
  /// Identical readings for longer than a sensor with noise can give.
  [[nodiscard]] bool frozen() const { return repeats_ >= kFrozenSamples; }

  /// One axis of the gyro stays at the very same rate while it turns: the end of its range.
  [[nodiscard]] bool gyro_clipped() const { return clipped_.maxCoeff() >= kClippedSamples; }

  template <class Archive>
  void serialise(Archive& a);

 private:
  static constexpr int kQuarters = 4;
  static constexpr int kFrozenSamples = 20;
  static constexpr int kClippedSamples = 8;
  static constexpr double kClippedRate = 0.05;  // rad/s, slower is no end of a range
  void finish_block(int64_t t_us);
  void find_noise();

  double spec_gyro_, spec_accel_, factor_, block_s_;
  ImuNoise noise_;
  ImuSample last_;
  int repeats_ = 0;
  Eigen::Vector3i clipped_ = Eigen::Vector3i::Zero();  // samples in a row, by axis
  std::array<NoiseBand, 3> bands_{NoiseBand(1), NoiseBand(4), NoiseBand(16)};
  Eigen::Matrix<double, 6, kQuarters> sums_ = Eigen::Matrix<double, 6, kQuarters>::Zero();
  Eigen::Vector4d times_ = Eigen::Vector4d::Zero();
  ImuBlock block_;
  int calm_blocks_ = 0;
};

template <class Archive>
void ImuMonitor::serialise(Archive& a) {
  a(noise_.gyro, noise_.accel, last_.t_us, last_.gyro, last_.accel, repeats_, clipped_.x(), clipped_.y(), clipped_.z(),
    sums_, times_, block_.end_us, block_.duration, block_.gyro, block_.accel, block_.gyro_wander, block_.accel_wander,
    calm_blocks_);
  for (NoiseBand& band : bands_) band.serialise(a);
}

}  // namespace roadfix
