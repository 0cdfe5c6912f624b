#include "navigation/aiding/zero_motion/zero_motion_control.h"

#include <cmath>

#include "navigation/aiding/zero_motion/zero_motion_model.h"

namespace roadfix::navigation {

namespace {

constexpr double kStandingSpeed = 0.3;  // m/s
constexpr double kStandingRate = 4e-3;  // rad/s
constexpr int kCalmBlocks = 6;          // in a row; of 5500 blocks of moving cars two at most were
constexpr double kMayBeZero = 16.3;     // chi-square of a velocity that may be zero, three axes, 99.9 %

}  // namespace

bool ZeroMotionControl::standing(const Filter& filter, const inertial::StandstillDetector& standstill,
                                 bool frozen) const {
  if (!config_.sources.zero_motion || !standstill.calm() || frozen) return false;
  const Mean& x = filter.state().x;
  if ((standstill.block().gyro - x.gyro_bias).norm() > kStandingRate) return false;
  if (x.nav.velocity.norm() < kStandingSpeed) return true;
  // A velocity that is hardly known carries little information; calm for long carries much.
  if (standstill.calm_blocks() < kCalmBlocks) return false;
  const Measurement<3> zero = zero_velocity(filter.state(), 1e-3);
  return filter.judge(AidingSource::kZeroVelocity, x.t_us, zero, kMayBeZero).status == AidingStatus::kAccepted;
}

AidingRecord ZeroMotionControl::use_velocity(Filter& filter, bool gated) const {
  return filter.fuse(AidingSource::kZeroVelocity, filter.state().x.t_us,
                     zero_velocity(filter.state(), config_.aiding.zero_velocity_std),
                     (gated ? gates_ : Gates::open()).nis[3]);
}

AidingRecord ZeroMotionControl::use_rate(Filter& filter, const inertial::ImuBlock& block, bool gated) const {
  const double sigma = std::hypot(config_.aiding.zero_rate_std, config_.facts.imu.gyro / std::sqrt(block.duration));
  return filter.fuse(AidingSource::kZeroRate, filter.state().x.t_us,
                     zero_rate(filter.state(), block.gyro, filter.earth().rate(), sigma),
                     (gated ? gates_ : Gates::open()).nis[3]);
}

}  // namespace roadfix::navigation
