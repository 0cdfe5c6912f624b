#include "wheel/standstill.h"

#include <cmath>

#include "samples/samples.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kStartMoved = 0.02;  ///< m, possible motion below the wheel speed threshold at a pull-away

}  // namespace

void Standstill::end(WheelState& state) {
  if (standing_) {
    decouple(state.P, kSpeed, standing_speed_);
    state.P.block<2, 2>(kPos, kPos) += kStartMoved * kStartMoved * Eigen::Matrix2d::Identity();
  }
  still_since_us_.reset();
  standing_ = false;
}

bool Standstill::add_speed(WheelState& state, int64_t t_us, double speed, bool trusted) {
  if (!trusted || std::abs(speed) > standing_speed_) {
    end(state);
    return false;
  }
  if (!still_since_us_) still_since_us_ = t_us;
  if (standing_ || seconds_between(*still_since_us_, t_us) < inertial::StandstillDetector::kBlock) return false;
  standing_ = true;
  state.x(kSpeed) = 0.0;
  decouple(state.P, kSpeed, 0.0);
  zero_rate_.begin();
  return true;
}

void Standstill::add_imu(WheelState& state, const ImuSample& imu, double dt_s, const Eigen::Vector3d& rate) {
  if (standing_) zero_rate_.add(dt_s, rate);
  if (!imu_.add(imu, dt_s, noise_, false)) return;
  const inertial::ImuBlock& block = imu_.block();
  const bool still_before = still_since_us_ && seconds_between(*still_since_us_, imu.t_us) > block.duration;
  if (still_before && !block.quiet()) return end(state);
  if (standing_) zero_rate_.update(state);
}

}  // namespace roadfix
