#include "gnss_ins/imu_monitor.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

constexpr double kNoiseTime = 2.0;  // s, memory of the scatter
constexpr int kManySamples = 1000;  // count no further
constexpr int kManyBlocks = 1000;   // likewise

}  // namespace

ImuMonitor::ImuMonitor(const GnssInsConfig& config)
    : spec_gyro_(config.vehicle.gyro_noise),
      spec_accel_(config.vehicle.accel_noise),
      factor_(config.propagation.vibration_factor),
      block_s_(config.aiding.zero_interval),
      noise_{spec_gyro_, spec_accel_} {}

void NoiseBand::add(const ImuSample& imu, double dt) {
  gyro_sum_ += imu.gyro;
  accel_sum_ += imu.accel;
  time_ += dt;
  if (++samples_ < length_) return;
  const Eigen::Vector3d gyro = gyro_sum_ / length_, accel = accel_sum_ / length_;
  if (means_ >= 2) {
    // Until the memory is full, the plain mean.
    const double weight = std::max(time_ / (time_ + kNoiseTime), 1.0 / (means_ - 1));
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

bool ImuMonitor::add(const ImuSample& imu, double dt) {
  repeats_ = imu.gyro == last_.gyro && imu.accel == last_.accel ? repeats_ + 1 : 0;
  for (int i = 0; i < 3; ++i)
    clipped_(i) = imu.gyro(i) == last_.gyro(i) && std::abs(imu.gyro(i)) > kClippedRate ? clipped_(i) + 1 : 0;
  last_ = imu;
  for (NoiseBand& band : bands_) band.add(imu, dt);
  find_noise();

  const double elapsed = times_.sum();
  const int quarter = std::min(kQuarters - 1, static_cast<int>(elapsed / block_s_ * kQuarters));
  sums_.col(quarter).head<3>() += dt * imu.gyro;
  sums_.col(quarter).tail<3>() += dt * imu.accel;
  times_(quarter) += dt;
  if (elapsed + dt < block_s_ - 1e-6) return false;
  finish_block(imu.t_us);
  return true;
}

void ImuMonitor::finish_block(int64_t t_us) {
  const double duration = times_.sum();
  block_.end_us = t_us;
  block_.duration = duration;
  block_.gyro = sums_.rowwise().sum().head<3>() / duration;
  block_.accel = sums_.rowwise().sum().tail<3>() / duration;
  block_.gyro_wander = block_.accel_wander = 0.0;
  for (int i = 0; i < kQuarters; ++i) {
    if (times_(i) <= 0.0) continue;
    const Eigen::Matrix<double, 6, 1> mean = sums_.col(i) / times_(i);
    block_.gyro_wander = std::max(block_.gyro_wander, (mean.head<3>() - block_.gyro).norm());
    block_.accel_wander = std::max(block_.accel_wander, (mean.tail<3>() - block_.accel).norm());
  }
  sums_.setZero();
  times_.setZero();
  const double quarter = std::sqrt(duration / kQuarters);
  const bool calm = block_.gyro_wander < 2e-3 + 3.0 * noise_.gyro / quarter &&
                    block_.accel_wander < 0.03 + 3.0 * noise_.accel / quarter;
  calm_blocks_ = calm && !frozen() ? std::min(calm_blocks_ + 1, kManyBlocks) : 0;
}

void ImuMonitor::find_noise() {
  ImuNoise quietest = bands_.front().density();
  for (const NoiseBand& band : bands_) {
    if (!band.known()) continue;
    quietest.gyro = std::min(quietest.gyro, band.density().gyro);
    quietest.accel = std::min(quietest.accel, band.density().accel);
  }
  noise_ = {std::max(spec_gyro_, factor_ * quietest.gyro), std::max(spec_accel_, factor_ * quietest.accel)};
}

}  // namespace roadfix
