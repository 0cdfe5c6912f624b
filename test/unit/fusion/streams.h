/// What the fusion reads, made from the simulator's truth: a GNSS/INS whose errors are what its covariance says and are
/// correlated in time as a filter's are, and odometries with noise, scale error and yaw drift.
#pragma once

#include <functional>
#include <vector>

#include "fusion/fusion.h"
#include "simulation/simulate.h"

namespace roadfix::test {

struct Outage {
  double begin_s = 0.0;
  double end_s = 0.0;
};

struct InsNoise {
  double rate_hz = 50.0;
  double fix_period = 1.0;      ///< s
  double fix_sigma = 0.05;      ///< m, white
  double yaw_sigma = 2e-3;      ///< rad, of what a fix tells about the yaw
  double velocity_walk = 0.03;  ///< m/s per sqrt(s)
  double yaw_walk = 3e-4;       ///< rad per sqrt(s)
  std::vector<Outage> outages;
  double claimed = 1.0;  ///< factor on the claimed standard deviations
  /// Added to the fixes at that time, not to the covariance: a receiver that is wrong.
  std::function<Eigen::Vector2d(double t_s)> lie;
};

struct VoNoise {
  double rate_hz = 10.0;
  double step_sigma = 0.005;  ///< m per frame
  double step_share = 0.002;  ///< of the step
  double yaw_step = 1.5e-4;   ///< rad per frame
  double scale_std = 0.01;    ///< drawn once
  double turns_std = 0.003;   ///< share of the turns, drawn once
  /// A frame's fault: changes the measured motion, or drops the frame (false).
  std::function<bool(double t_s, Planar& motion)> fault;
};

/// One sample with what the INS says about GNSS at that time.
struct StreamEvent {
  ChannelSample sample;
  bool gnss = true;
};

std::vector<StreamEvent> ins_stream(const SimulatedDrive& drive, const InsNoise& noise, std::uint64_t seed);
std::vector<StreamEvent> vo_stream(const SimulatedDrive& drive, const VoNoise& noise, std::uint64_t seed);
/// As the VO's, in the wheels' channel, with the turns' share of a gyro.
std::vector<StreamEvent> wheel_stream(const SimulatedDrive& drive, VoNoise noise, std::uint64_t seed);

/// In the order of time, GNSS/INS first.
std::vector<StreamEvent> merged(const std::vector<std::vector<StreamEvent>>& streams);

/// Called after each sample, with what is published then.
using OnFused = std::function<void(const FusedPoses&, const StreamEvent&)>;
void run(Fusion& fusion, const std::vector<StreamEvent>& events, const OnFused& on_fused);

/// Error of a pose in the plane: truth minus estimate, and its covariance.
struct PlanarError {
  Planar error = Planar::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Identity();
  [[nodiscard]] double nees() const { return error.dot(cov.ldlt().solve(error)); }
  [[nodiscard]] double distance() const { return error.head<2>().norm(); }
};
PlanarError planar_error(const SimulatedDrive& drive, const Odometry& estimate);

}  // namespace roadfix::test
