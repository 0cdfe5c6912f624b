/// What moves the state: imu samples or, in a car without an imu, those that its own motion makes in their place, (N.2) of
/// MODEL.md. They wait between the state's epoch and now; the state stays behind the horizon by the longest latency that is
/// possible yet, so that every measurement is used at its own moment.
#pragma once

#include "inertial/imu_ring.h"
#include "inertial/standstill.h"
#include "navigation/motion/car_motion.h"

namespace roadfix::navigation {

enum class InputStatus { kAccepted, kBadInput, kOutOfOrder };

class MotionInput {
 public:
  explicit MotionInput(const NavigationConfig& config);

  /// What a car's imu may read.
  [[nodiscard]] static bool plausible(const ImuSample& imu);
  /// The newest sample; without an imu a wheel sample, or nothing but the time.
  InputStatus see(const ImuSample& imu);
  InputStatus see(const WheelSample& wheels);
  InputStatus see(int64_t t_us);
  /// Nothing has come yet, not even a bad sample.
  [[nodiscard]] bool untouched() const { return last_us_ == 0 && ring_.empty() && bad_samples_ == 0; }
  /// Of the newest sample, 0 before the first.
  [[nodiscard]] int64_t newest_us() const { return ring_.empty() ? last_us_ : ring_.back().t_us; }

  /// One sample for the state to be moved over.
  struct Step {
    ImuSample imu;
    double dt = 0.0;          ///< s since the one before, 0 for the first
    bool gap = false;         ///< longer than samples may be apart
    bool block_done = false;  ///< it ends a block of the standstill test
  };
  /// The next one that the horizon has left behind by the lag.
  [[nodiscard]] std::optional<Step> next(int64_t horizon_us);
  /// s, between 0 and 1.5.
  void set_lag(double lag);
  /// As long as the calibration's latencies may be.
  void reset_lag();
  [[nodiscard]] double lag() const { return 1e-6 * static_cast<double>(lag_us_); }
  /// Of the last step, 0 before the first.
  [[nodiscard]] int64_t last_us() const { return last_us_; }
  /// Samples behind the last step.
  [[nodiscard]] const inertial::ImuRing& ring() const { return ring_; }

  /// Densities over the sample of `dt` s that ends at t_us, at this speed, m/s, (N.2.6) and (N.2.8).
  [[nodiscard]] inertial::ImuNoise noise(int64_t t_us, double dt, double speed) const;
  /// Of the imu as it is now.
  [[nodiscard]] const inertial::ImuNoise& imu_noise() const { return imu_noise_.noise(); }
  [[nodiscard]] bool frozen() const { return imu_noise_.frozen(); }
  [[nodiscard]] const inertial::StandstillDetector& standstill() const { return standstill_; }
  [[nodiscard]] CarMotion& car() { return car_; }
  [[nodiscard]] const CarMotion& car() const { return car_; }
  /// rad that a car may turn by, unseen, in a gap of `dt` s.
  [[nodiscard]] static double unseen_turn(double dt);

  [[nodiscard]] int64_t bad_samples() const { return bad_samples_; }
  [[nodiscard]] int64_t gaps() const { return gaps_; }

  template <class Archive>
  void serialise(Archive& a) {
    imu_noise_.serialise(a);
    standstill_.serialise(a);
    car_.serialise(a);
    ring_.serialise(a);
    a(lag_us_, last_us_, bad_samples_, gaps_);
  }

 private:
  VehicleFacts facts_;
  double max_gap_;
  inertial::ImuNoiseEstimator imu_noise_;
  inertial::StandstillDetector standstill_;
  CarMotion car_;
  inertial::ImuRing ring_;
  int64_t lag_us_ = 0, last_us_ = 0;
  int64_t bad_samples_ = 0, gaps_ = 0;
};

}  // namespace roadfix::navigation
