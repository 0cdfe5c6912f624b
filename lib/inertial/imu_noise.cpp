#include "inertial/imu_noise.h"

#include <algorithm>
#include <cmath>

namespace roadfix::inertial {

namespace {

constexpr double kMemory = 2.0;     // s, of the scatter
constexpr int kManySamples = 1000;  // count no further

}  // namespace

void NoiseBand::add(const ImuSample& imu, double dt) {
  gyro_sum_ += imu.gyro;
  accel_sum_ += imu.accel;
  time_ += dt;
  if (++samples_ < length_) return;
  const Eigen::Vector3d gyro = gyro_sum_ / length_, accel = accel_sum_ / length_;
  if (means_ >= 2) {
    // Until the memory is full, the plain mean.
    const double weight = std::max(time_ / (time_ + kMemory), 1.0 / (means_ - 1));
    gyro_ += weight * ((gyro - 2.0 * gyro_one_ + gyro_two_).squaredNorm() / 18.0 * time_ - gyro_);
    accel_ += weight * ((accel - 2.0 * accel_one_ + accel_two_).squaredNorm() / 18.0 * time_ - accel_);
  }
  gyro_two_ = gyro_one_;
  gyro_one_ = gyro;
  accel_two_ = accel_one_;
  accel_one_ = accel;
  means_ = std::min(means_ + 1, kManySamples);
  gyro_sum_.setZero();
  accel_sum_.setZero();
  time_ = 0.0;
  samples_ = 0;
}

ImuNoise NoiseBand::density() const { return {std::sqrt(gyro_), std::sqrt(accel_)}; }

void ImuNoiseEstimator::add(const ImuSample& imu, double dt) {
  repeats_ = imu.gyro == last_.gyro && imu.accel == last_.accel ? repeats_ + 1 : 0;
  for (int i = 0; i < 3; ++i)
    clipped_(i) = imu.gyro(i) == last_.gyro(i) && std::abs(imu.gyro(i)) > kClippedRate ? clipped_(i) + 1 : 0;
  last_ = imu;
  for (NoiseBand& band : bands_) band.add(imu, dt);
  ImuNoise quietest = bands_.front().density();
  for (const NoiseBand& band : bands_) {
    if (!band.known()) continue;
    quietest.gyro = std::min(quietest.gyro, band.density().gyro);
    quietest.accel = std::min(quietest.accel, band.density().accel);
  }
  noise_ = {std::max(datasheet_.gyro, quietest.gyro), std::max(datasheet_.accel, quietest.accel)};
}

}  // namespace roadfix::inertial
