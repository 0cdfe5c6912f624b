#include "navigation/aiding/zero_motion/zero_motion_control.h"

#include <algorithm>
#include <cmath>

#include "navigation/aiding/zero_motion/zero_motion_model.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr double kStandingRate = 4e-3;  // rad/s
constexpr int kCalmBlocks = 6;          // in a row; of 5500 blocks of moving cars two at most were
constexpr double kMayBeZero = 16.3;     // chi-square of a velocity that may be zero, three axes, 99.9 %

}  // namespace

bool ZeroMotionControl::standing(const Filter& filter, const inertial::StandstillDetector& standstill, bool frozen,
                                 bool still) const {
  if (!config_.sources.zero_motion || frozen) return false;
  if (!standstill.calm() && !(still && standstill.block().quiet())) return false;
  const Mean& x = filter.state().x;
  // A mean of quarters that differ by more than an idling engine makes them is known by as much less.
  const double rate = kStandingRate + (standstill.calm() ? 0.0 : 0.5 * standstill.block().gyro_spread);
  if ((standstill.block().gyro - x.gyro_bias).norm() > rate) return false;
  if (x.nav.velocity.norm() < vehicle::kStandingSpeed) return true;
  // A velocity that is hardly known carries little information; calm for long carries much.
  if (standstill.calm_blocks() < kCalmBlocks) return false;
  const Measurement<3> zero = zero_velocity(filter.state(), 1e-3);
  return filter.judge(AidingSource::kZeroVelocity, x.t_us, zero, kMayBeZero).status == AidingStatus::kAccepted;
}

AidingRecord ZeroMotionControl::use_velocity(Filter& filter, bool gated, bool calm) const {
  const double sigma = std::max(config_.aiding.zero_velocity_std, calm ? 0.0 : vehicle::kStillVelocity);
  return filter.fuse(AidingSource::kZeroVelocity, filter.state().x.t_us, zero_velocity(filter.state(), sigma),
                     (gated ? gates_ : Gates::open()).nis[3]);
}

AidingRecord ZeroMotionControl::use_rate(Filter& filter, const inertial::ImuBlock& block, bool gated, bool calm) const {
  const double sigma = std::hypot(config_.aiding.zero_rate_std, config_.facts.imu.gyro / std::sqrt(block.duration),
                                  calm ? 0.0 : 0.5 * block.gyro_spread);
  return filter.fuse(AidingSource::kZeroRate, filter.state().x.t_us,
                     zero_rate(filter.state(), block.gyro, filter.earth().rate(), sigma),
                     (gated ? gates_ : Gates::open()).nis[3]);
}

}  // namespace roadfix::navigation
