#include "navigation/motion/motion_input.h"
#include "statistics/chance.h"
#include "vehicle/driving.h"

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr double kMaxLag = 1.5;      // s behind the horizon, for receivers that stamp late
constexpr double kMaxRate = 20.0;    // rad/s, more is not a car
constexpr double kMaxForce = 200.0;  // m/s2, likewise
constexpr double kBridgeRate = 0.2;  // rad/s
constexpr double kClipTime = 1.0;    // s that a turn beyond the gyro's range lasts

}  // namespace

MotionInput::MotionInput(const NavigationConfig& config)
    : facts_(config.facts), max_gap_(config.process.max_gap), imu_noise_(config.facts.imu), car_(config) {
  reset_lag();
}

bool MotionInput::plausible(const ImuSample& s) {
  return s.gyro.allFinite() && s.accel.allFinite() && s.gyro.norm() < kMaxRate && s.accel.norm() < kMaxForce;
}

InputStatus MotionInput::see(const ImuSample& imu) {
  if (!plausible(imu)) {
    ++bad_samples_;
    return InputStatus::kBadInput;
  }
  if (imu.t_us <= newest_us()) return InputStatus::kOutOfOrder;
  ring_.push(imu);
  return InputStatus::kAccepted;
}

InputStatus MotionInput::see(const WheelSample& wheels) {
  const bool taken = car_.add(wheels, [&](const ImuSample& s) { ring_.push(s); });
  return taken ? InputStatus::kAccepted : InputStatus::kOutOfOrder;
}

InputStatus MotionInput::see(int64_t t_us) {
  const bool taken = car_.pass(t_us, [&](const ImuSample& s) { ring_.push(s); });
  return taken ? InputStatus::kAccepted : InputStatus::kOutOfOrder;
}

std::optional<MotionInput::Step> MotionInput::next(int64_t horizon_us) {
  if (ring_.empty() || ring_.front().t_us > horizon_us - lag_us_) return std::nullopt;
  Step step;
  step.imu = ring_.front();
  ring_.pop();
  if (last_us_ != 0) step.dt = seconds_between(last_us_, step.imu.t_us);
  last_us_ = step.imu.t_us;
  if (step.dt <= 0.0) return step;
  step.gap = step.dt > max_gap_;
  if (step.gap) {
    ++gaps_;
  } else {
    if (facts_.has_imu) imu_noise_.add(step.imu, step.dt);
    step.block_done = standstill_.add(step.imu, step.dt, imu_noise_.noise(), imu_noise_.frozen());
  }
  return step;
}

void MotionInput::set_lag(double lag) { lag_us_ = static_cast<int64_t>(1e6 * std::clamp(lag, 0.0, kMaxLag)); }

void MotionInput::reset_lag() {
  const ClockPriors time(facts_);
  set_lag(kChance * std::hypot(std::max(time.position_latency, time.velocity_latency), time.imu_offset));
}

inertial::ImuNoise MotionInput::noise(int64_t t_us, double dt, double speed) const {
  if (!facts_.has_imu) return car_.noise(t_us, speed);
  inertial::ImuNoise noise = imu_noise_.noise();
  // White noise that over this time does what an unseen manoeuvre may do, (N.2.6).
  if (dt > max_gap_ || imu_noise_.frozen())
    noise = {kBridgeRate * std::sqrt(dt), vehicle::kUnseenAccel * std::sqrt(dt), 0.0};
  if (imu_noise_.gyro_clipped()) noise.gyro = kBridgeRate * std::sqrt(kClipTime);
  return noise;
}

double MotionInput::unseen_turn(double dt) { return kBridgeRate * dt; }

}  // namespace roadfix::navigation
