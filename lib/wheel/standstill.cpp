#include "wheel/standstill.h"

#include <cmath>

#include "samples/samples.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kGyroSmoothing = 0.2;        ///< s, longer than engine vibration, shorter than a pull-away
constexpr double kStandingSpeedSigma = 1e-3;  ///< m/s
constexpr double kStartMoved = 0.02;          ///< m, possible motion below the wheel speed threshold at a pull-away

}  // namespace

void Standstill::end() {
  still_since_us_.reset();
  standing_ = false;
}

bool Standstill::add_speed(WheelState& state, int64_t t_us, double speed, bool trusted) {
  const bool stood = standing_;
  if (!trusted || std::abs(speed) > tuning_.standing_speed) {
    end();
  } else {
    if (!still_since_us_) {
      still_since_us_ = t_us;
      reference_gyro_ = filtered_gyro_;
    }
    standing_ = seconds_between(*still_since_us_, t_us) >= tuning_.standing_after;
  }
  if (standing_ && !stood) {
    state.x(kSpeed) = 0.0;
    decouple(state.P, kSpeed, kStandingSpeedSigma);
    zero_rate_.begin();
  }
  if (stood && !standing_) {
    decouple(state.P, kSpeed, tuning_.standing_speed);
    state.P.block<2, 2>(kPos, kPos) += kStartMoved * kStartMoved * Eigen::Matrix2d::Identity();
  }
  return standing_ && !stood;
}

void Standstill::add_rate(WheelState& state, double dt_s, const Eigen::Vector3d& gyro, const Eigen::Vector3d& rate) {
  const bool stood = standing_;
  filtered_gyro_ += dt_s / (kGyroSmoothing + dt_s) * (gyro - filtered_gyro_);
  // A change of the rate since the beginning, so that the gyro bias cancels.
  if (still_since_us_ && (filtered_gyro_ - reference_gyro_).cwiseAbs().maxCoeff() > tuning_.standing_rate) end();
  if (stood) zero_rate_.add(state, dt_s, rate);
}

}  // namespace roadfix
