#include "gnss_ins/imu_monitor.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

constexpr double kNoiseTime = 1.0;  // s, memory of the scatter
constexpr int kManySamples = 1000;  // count no further

}  // namespace

ImuMonitor::ImuMonitor(const GnssInsConfig& config)
    : spec_gyro_(config.vehicle.gyro_noise),
      spec_accel_(config.vehicle.accel_noise),
      factor_(config.propagation.vibration_factor),
      block_s_(config.aiding.zero_interval) {}

bool ImuMonitor::add(const ImuSample& imu, double dt) {
  repeats_ = count_ > 0 && imu.gyro == one_.gyro && imu.accel == one_.accel ? repeats_ + 1 : 0;
  if (count_ >= 2) {
    // A second difference of white noise has six times its variance; mean of three axes.
    const double gyro = (imu.gyro - 2.0 * one_.gyro + two_.gyro).squaredNorm() / 18.0;
    const double accel = (imu.accel - 2.0 * one_.accel + two_.accel).squaredNorm() / 18.0;
    // Until the memory is full, the plain mean.
    const double weight = std::max(dt / (dt + kNoiseTime), 1.0 / (count_ - 1));
    gyro_variance_ += weight * (gyro - gyro_variance_);
    accel_variance_ += weight * (accel - accel_variance_);
  }
  dt_ = dt;
  two_ = one_;
  one_ = imu;
  count_ = std::min(count_ + 1, kManySamples);

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
}

ImuNoise ImuMonitor::noise() const {
  const double scale = factor_ * std::sqrt(dt_);
  return {std::max(spec_gyro_, scale * std::sqrt(gyro_variance_)),
          std::max(spec_accel_, scale * std::sqrt(accel_variance_))};
}

}  // namespace roadfix
