/// Trajectories over time: interpolation, and pairs of estimate and reference at common times.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "samples/samples.h"

namespace roadfix {

/// Poses in order of time, strictly increasing t_us, all in one frame.
struct Trajectory {
  std::vector<Odometry> poses;
  bool has_attitude = true;
  bool has_velocity = true;  ///< in vehicle axes with attitude, in the frame's axes without
};

/// The pose at t_us: position by cubic Hermite where there is velocity and by line elsewhere, attitude along the
/// geodesic, the rest linear, validity the lower one. Nothing outside the trajectory or in a gap longer than
/// max_gap_us.
std::optional<Odometry> interpolate(const Trajectory& trajectory, int64_t t_us, int64_t max_gap_us);

/// Median of the intervals between poses, us; zero below two poses.
int64_t median_interval_us(const Trajectory& trajectory);

/// The largest gap that interpolation bridges: three median intervals, at least 0.25 s.
int64_t default_max_gap_us(const Trajectory& trajectory);

/// The same pose of other axes, whose coordinates `turn` takes to the pose's. Covariances follow.
Odometry in_axes(const Eigen::Quaterniond& turn, const Odometry& pose);

/// The same pose of another point: `lever_arm` from the origin, in the pose's axes. Covariance follows.
Odometry at_lever_arm(const Odometry& pose, const Eigen::Vector3d& lever_arm);

struct PosePair {
  Odometry estimate;
  Odometry reference;  ///< at the same t_us
};

/// Pairs at the times of the sparser stream, the denser one interpolated. `keep_reference` forbids to interpolate the
/// reference (noisy fixes): pairs are then at its times. `estimate_delay_us` pairs reference time t with estimate time
/// t - delay. Invalid estimates make no pair.
std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& reference, bool keep_reference,
                                int64_t estimate_delay_us = 0);

/// Length of the reference path up to each pair, m, starting at zero.
std::vector<double> path_lengths(const std::vector<PosePair>& pairs);

}  // namespace roadfix
