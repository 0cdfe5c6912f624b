/// White noise of the imu as it is now, from the scatter of its own samples, (I.3.1); frozen and clipped readings.
#pragma once

#include <array>

#include "samples/samples.h"

namespace roadfix::inertial {

/// What biases and scales change by from one turn-on to the next, as a share of the spread that a calibration gives (assumed;
/// temperature, load, tyre pressure).
inline constexpr double kTurnOnChange = 0.3;

/// Densities of the white noise.
struct ImuNoise {
  double gyro = 0.0;   ///< rad/s/sqrt(Hz)
  double accel = 0.0;  ///< m/s2/sqrt(Hz)
  double tilt = 0.0;   ///< rad/s/sqrt(Hz), of rates about the level axes that no gyro measures; an imu's have none
};

/// Density from second differences of means over `length` samples: a second difference of white noise has six times its
/// variance; a car's motion hardly reaches it, a vibration does.
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

class ImuNoiseEstimator {
 public:
  /// `datasheet`: the least that is used.
  explicit ImuNoiseEstimator(const ImuNoise& datasheet) : datasheet_(datasheet), noise_(datasheet) {}

  void add(const ImuSample& imu, double dt);

  /// White noise shows alike in every band, a vibration in some and motion in the slow one: the quietest band counts.
  [[nodiscard]] const ImuNoise& noise() const { return noise_; }
  /// Identical readings for longer than a sensor with noise can give.
  [[nodiscard]] bool frozen() const { return repeats_ >= kFrozenSamples; }
  /// One axis of the gyro stays at the very same rate while it turns: the end of its range.
  [[nodiscard]] bool gyro_clipped() const { return clipped_.maxCoeff() >= kClippedSamples; }

  template <class Archive>
  void serialise(Archive& a) {
    a(noise_.gyro, noise_.accel, last_.t_us, last_.gyro, last_.accel, repeats_, clipped_.x(), clipped_.y(),
      clipped_.z());
    for (NoiseBand& band : bands_) band.serialise(a);
  }

 private:
  static constexpr int kFrozenSamples = 20;
  static constexpr int kClippedSamples = 8;
  static constexpr double kClippedRate = 0.05;  // rad/s, slower is no end of a range

  ImuNoise datasheet_, noise_;
  ImuSample last_;
  int repeats_ = 0;
  Eigen::Vector3i clipped_ = Eigen::Vector3i::Zero();  // samples in a row, by axis
  std::array<NoiseBand, 3> bands_{NoiseBand(1), NoiseBand(4), NoiseBand(16)};
};

}  // namespace roadfix::inertial
