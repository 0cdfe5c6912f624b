/// A small car without an imu: one wheel speed and a yaw rate at 5 Hz, single fixes whose errors last. Wheel samples are
/// the clock, fixes come at the horizon; without wheels the fixes are the clock.
#pragma once

#include <algorithm>

#include "filter_run.h"

namespace roadfix::navtest {

inline SimulatedDrive small_car(uint64_t seed, double duration_s = 180.0) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = duration_s;
  s.gnss.rate_hz = 1.0;
  s.gnss.fix_type = FixType::kSingle;
  s.gnss.sigma_horizontal_m = 2.0;
  s.gnss.sigma_up_m = 4.0;
  s.gnss.multipath_sigma_m = 2.0;
  s.gnss.multipath_correlation_s = 8.0;
  s.gnss.sigma_velocity_mps = 0.0;
  s.gnss.lever_arm_m = {0.0, 0.0, 1.4};
  s.wheels.layout = WheelLayout::kOneSpeed;
  s.wheels.rate_hz = 5.0;
  s.wheels.has_yaw_rate = true;
  return simulate(s, seed);
}

inline NavigationConfig config_of(const SimulatedDrive& drive) {
  NavigationConfig c = navtest::filter_config(drive.config);
  c.facts.wheels.yaw_rate_noise = drive.config.wheels.yaw_rate_noise_radps;
  c.facts.wheels.yaw_rate_bias = drive.config.wheels.yaw_rate_bias_std_radps;
  return c;
}

class CarFeeder {
 public:
  CarFeeder(const std::vector<WheelSample>& wheels, const std::vector<GnssFix>& gnss) : wheels_(wheels), gnss_(gnss) {}

  bool step(Navigation& filter) {
    constexpr int64_t kLateness = 250'000;
    const size_t ticks = wheels_.empty() ? gnss_.size() : wheels_.size();
    if (tick_ == ticks) return false;
    now_ = wheels_.empty() ? gnss_[tick_].t_us : wheels_[tick_].t_us;
    (void)(wheels_.empty() ? filter.see(now_) : filter.see(wheels_[tick_]));
    ++tick_;
    while (true) {
      const int64_t wheel_t = wheel_ < wheels_.size() ? wheels_[wheel_].t_us : INT64_MAX;
      const int64_t fix_t = fix_ < gnss_.size() ? gnss_[fix_].t_us : INT64_MAX;
      if (std::min(wheel_t, fix_t) > now_ - kLateness) return true;
      if (fix_t <= wheel_t)
        filter.add(gnss_[fix_++]);
      else
        filter.add(wheels_[wheel_++]);
    }
  }
  [[nodiscard]] int64_t now() const { return now_; }

 private:
  const std::vector<WheelSample>& wheels_;
  const std::vector<GnssFix>& gnss_;
  size_t tick_ = 0, wheel_ = 0, fix_ = 0;
  int64_t now_ = 0;
};

struct Score {
  double h = 0.0, fixes_h = 0.0;  ///< m, RMS after 40 s
  double inside = 0.0;            ///< share within three sigmas of 2-D
  double nees = 0.0;              ///< of the two, over two
  double valid = 0.0;
};

inline Score drive_through(const SimulatedDrive& drive, const std::vector<WheelSample>& wheels,
                           const std::vector<GnssFix>& gnss) {
  Navigation filter(config_of(drive));
  Score out;
  int n = 0, all = 0, inside = 0, fixes = 0;
  const int64_t from = drive.wheels.front().t_us + 40'000'000;
  for (CarFeeder feeder(wheels, gnss); feeder.step(filter);) {
    filter.clear_records();
    if (feeder.now() < from || !filter.anchor()) continue;
    ++all;
    const NavigationOutput o = filter.output();
    if (o.odometry.validity == Validity::kInvalid) continue;
    ++n;
    const Eigen::Vector2d e = navtest::error_of(filter, o.imu, drive).head<2>();
    out.h += e.squaredNorm();
    const double squares = e.dot(o.odometry.cov_pose.topLeftCorner<2, 2>().inverse() * e);
    inside += squares < 11.8;  // chi-square, 3 sigma, 2 axes
    out.nees += 0.5 * squares;
  }
  for (const GnssFix& fix : gnss) {
    if (fix.t_us < from) continue;
    const Odometry truth = drive.truth_at(fix.t_us);
    const Eigen::Vector3d antenna = truth.T_frame_vehicle * drive.config.gnss.lever_arm_m;
    out.fixes_h += (drive.anchor.enu(fix.antenna) - antenna).head<2>().squaredNorm();
    ++fixes;
  }
  out.h = n == 0 ? 1e9 : std::sqrt(out.h / n);
  out.fixes_h = std::sqrt(out.fixes_h / fixes);
  out.inside = n == 0 ? 0.0 : static_cast<double>(inside) / n;
  out.nees /= std::max(1, n);
  out.valid = static_cast<double>(n) / all;
  return out;
}

}  // namespace roadfix::navtest
