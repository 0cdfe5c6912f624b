/// A car on a straight and a bend whose true place is known, an estimate of it that follows its receiver, and dead
/// reckoning with a scale and a turn of its own: what lib/integrity is given, and what its levels are held against.
#pragma once

#include <functional>
#include <vector>

#include "geometry/euler.h"
#include "integrity/protection.h"
#include "simulation/random.h"

namespace roadfix::test {

struct CarOptions {
  uint64_t seed = 1;
  double seconds = 200.0;
  bool witness = true;
  double witness_until = 1e9;  ///< s
  double sigma = 0.02;         ///< m, of the estimate's errors
  double claim = 1.0;          ///< of which this share is claimed
  double innovation = 1.0;     ///< sigma of innovations over what is claimed
  double every_fix_s = 0.2;
  bool even = false;  ///< innovations of exactly that size, of alternating sign
  std::function<Eigen::Vector3d(double)> fault = [](double) { return Eigen::Vector3d::Zero().eval(); };  ///< m, enu
  bool follows = false;  ///< the estimate's velocity is that of its place, fault included
  std::function<bool(double)> fixes = [](double) { return true; };
};

struct CarSample {
  double t = 0.0;
  Eigen::Vector3d error = Eigen::Vector3d::Zero();  ///< m, along, across, up, magnitudes
  Protection protection;

  [[nodiscard]] bool misleading(Risk risk) const {
    return (error.array() > protection.level[static_cast<std::size_t>(risk)].array()).any();
  }
};

struct TrueCar {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  double yaw = 0.3;

  /// 15 m/s, a bend from 60 to 75 s.
  void step(double t, double dt) {
    yaw += dt * rate(t);
    p += 15.0 * dt * Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0);
  }
  static double rate(double t) { return t > 60.0 && t < 75.0 ? 0.1 : 0.0; }
};

inline Odometry pose(int64_t t_us, const Eigen::Vector3d& p, double yaw, double rate, double sigma) {
  Odometry o;
  o.t_us = t_us;
  o.T_frame_vehicle = {quaternion({yaw, 0.0, 0.0}), p};
  o.velocity = {15.0, 0.0, 0.0};
  o.angular_rate = {0.0, 0.0, rate};
  o.cov_pose.diagonal() << sigma * sigma, sigma * sigma, sigma * sigma, 1e-8, 1e-8, 1e-8;
  o.validity = Validity::kValid;
  return o;
}

/// Ten samples a second, from the first on. `at` may exchange the monitor (a snapshot).
inline std::vector<CarSample> drive(const CarOptions& options, const IntegrityConfig& config,
                                    const std::function<void(double, ProtectionMonitor&)>& at = {}) {
  constexpr double kStep = 0.1;
  ProtectionMonitor monitor(config);
  RandomStream noise(options.seed, 1), innovations(options.seed, 2);
  TrueCar car;
  Eigen::Vector3d error = options.sigma * noise.normal3();
  Eigen::Vector3d reckoned = Eigen::Vector3d::Zero();
  double reckoned_yaw = 0.0;
  double next_fix = 0.0;
  std::vector<CarSample> samples;
  for (int i = 1; i <= static_cast<int>(options.seconds / kStep); ++i) {
    const double t = kStep * i;
    const auto t_us = static_cast<int64_t>(i) * 100'000;
    car.step(t, kStep);
    const double rate = TrueCar::rate(t);
    reckoned_yaw += kStep * (rate + 5e-4);
    reckoned += 1.008 * 15.0 * kStep * Eigen::Vector3d(std::cos(reckoned_yaw), std::sin(reckoned_yaw), 0.0);
    error = 0.98 * error + std::sqrt(1.0 - 0.98 * 0.98) * options.sigma * noise.normal3();
    if (options.witness && t < options.witness_until)
      monitor.add_witness(pose(t_us, reckoned, reckoned_yaw, rate, 0.1), 0);
    if (options.fixes(t) && t >= next_fix) {
      next_fix = t + options.every_fix_s - 1e-9;
      const double sign = i / 2 % 2 == 0 ? 1.0 : -1.0;
      const Eigen::Vector3d size = options.even ? Eigen::Vector3d::Constant(sign) : innovations.normal3();
      const Eigen::Vector3d z = options.innovation * size;
      monitor.add({t_us, true, z.squaredNorm(), 3, 0.02 * z, Eigen::Vector3d::Constant(4e-4)});
    }
    const Eigen::Vector3d off = error + options.fault(t);
    Odometry estimate = pose(t_us, car.p + off, car.yaw, rate, options.claim * options.sigma);
    if (options.follows)
      estimate.velocity +=
          estimate.T_frame_vehicle.q.conjugate() * (options.fault(t) - options.fault(t - kStep)) / kStep;
    if (at) at(t, monitor);
    const Eigen::Vector3d seen = (estimate.T_frame_vehicle.q.conjugate() * off).cwiseAbs();
    samples.push_back({t, seen, monitor.bound(estimate)});
  }
  return samples;
}

}  // namespace roadfix::test
