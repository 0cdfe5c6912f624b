#include "inertial/standstill.h"
#include "statistics/chance.h"

#include <algorithm>
#include <cmath>

namespace roadfix::inertial {

namespace {

constexpr double kEngineRate = 2e-3;   // rad/s, by which an idling engine moves a quarter's mean
constexpr double kEngineForce = 0.03;  // m/s2, likewise
constexpr int kManyBlocks = 1000;      // count no further

}  // namespace

bool StandstillDetector::add(const ImuSample& imu, double dt, const ImuNoise& noise, bool frozen) {
  const double elapsed = times_.sum();
  const int quarter = std::min(kQuarters - 1, static_cast<int>(elapsed / kBlock * kQuarters));
  sums_.col(quarter).head<3>() += dt * imu.gyro;
  sums_.col(quarter).tail<3>() += dt * imu.accel;
  times_(quarter) += dt;
  if (elapsed + dt < kBlock - 1e-6) return false;
  finish_block(imu.t_us, noise, frozen);
  return true;
}

void StandstillDetector::finish_block(int64_t t_us, const ImuNoise& noise, bool frozen) {
  const double duration = times_.sum();
  const Eigen::Matrix<double, 6, 1> mean = sums_.rowwise().sum() / duration;
  block_ = {t_us, duration, mean.head<3>(), mean.tail<3>(), 0.0, 0.0};
  for (int i = 0; i < kQuarters; ++i) {
    if (times_(i) <= 0.0) continue;
    const Eigen::Matrix<double, 6, 1> off = sums_.col(i) / times_(i) - mean;
    block_.gyro_spread = std::max(block_.gyro_spread, off.head<3>().norm());
    block_.accel_spread = std::max(block_.accel_spread, off.tail<3>().norm());
  }
  sums_.setZero();
  times_.setZero();
  const double root = std::sqrt(duration / kQuarters);
  const bool calm = block_.gyro_spread < kEngineRate + kChance * noise.gyro / root &&
                    block_.accel_spread < kEngineForce + kChance * noise.accel / root;
  calm_blocks_ = calm && !frozen ? std::min(calm_blocks_ + 1, kManyBlocks) : 0;
}

}  // namespace roadfix::inertial
