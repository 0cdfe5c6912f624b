#include <cmath>

#include "simulation/sensors.h"

namespace roadfix {
namespace {

/// Antenna in the axes east, north, up at itself.
struct AntennaState {
  Eigen::Vector3d p_enu = Eigen::Vector3d::Zero();     ///< in the anchor's frame
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< local axes
  Eigen::Matrix3d R_anchor_here = Eigen::Matrix3d::Identity();
};

AntennaState antenna_at(const SimulatedDrive& drive, double t_s) {
  const Motion& motion = *drive.motion;
  const Kinematics k = motion.at(std::clamp(t_s, motion.begin_s(), motion.end_s()));
  AntennaState a;
  a.p_enu = k.T_enu_vehicle * drive.errors.gnss_lever_arm;
  a.R_anchor_here = drive.anchor.R_anchor_enu_at(drive.anchor.geodetic(a.p_enu));
  const Eigen::Vector3d turning = k.T_enu_vehicle.q * k.angular_rate.cross(drive.errors.gnss_lever_arm);
  a.velocity = a.R_anchor_here.transpose() * (k.velocity_enu + turning);
  return a;
}

}  // namespace

void simulate_gnss(SimulatedDrive& drive) {
  const GnssConfig& c = drive.config.gnss;
  RandomStream position_noise = stream_of(drive, NoiseStream::kGnssPosition);
  RandomStream velocity_noise = stream_of(drive, NoiseStream::kGnssVelocity);
  GaussMarkov3 multipath(1.0, c.multipath_correlation_s, stream_of(drive, NoiseStream::kGnssMultipath));
  drive.errors.gnss_lever_arm =
      c.lever_arm_m + c.lever_arm_std_m * stream_of(drive, NoiseStream::kGnssLeverArm).normal3();
  if (c.rate_hz <= 0.0) return;
  const Eigen::Vector3d sigma(c.sigma_horizontal_m, c.sigma_horizontal_m, c.sigma_up_m);
  const Eigen::Vector3d sigma_multipath = c.multipath_sigma_m * Eigen::Vector3d(1.0, 1.0, 2.0);
  const Eigen::Vector3d claimed =
      c.claimed_sigma_factor * (sigma.cwiseAbs2() + sigma_multipath.cwiseAbs2()).cwiseSqrt();
  for (const std::int64_t t_us : sample_times(c.rate_hz, c.phase_s, drive.config.duration_s)) {
    const double t_s = seconds_between(0, t_us);
    GnssError error;
    error.position = sigma.cwiseProduct(position_noise.normal3()) + sigma_multipath.cwiseProduct(multipath.value());
    error.velocity = c.sigma_velocity_mps * velocity_noise.normal3();
    multipath.advance(1.0 / c.rate_hz);
    const AntennaState antenna = antenna_at(drive, t_s - c.position_latency_s);
    GnssFix fix;
    fix.t_us = drive.config.start_utime + t_us;
    fix.fix_type = FixType::kRtkFixed;
    fix.antenna = drive.anchor.geodetic(antenna.p_enu + antenna.R_anchor_here * error.position);
    fix.cov_enu = claimed.cwiseAbs2().asDiagonal();
    if (c.sigma_velocity_mps > 0.0) {
      const double claimed_velocity = c.claimed_sigma_factor * c.sigma_velocity_mps;
      fix.velocity = GnssVelocity{antenna_at(drive, t_s - c.velocity_latency_s).velocity + error.velocity,
                                  Eigen::Matrix3d::Identity() * claimed_velocity * claimed_velocity};
    }
    drive.gnss.push_back(fix);
    drive.errors.gnss.push_back(error);
  }
}

}  // namespace roadfix
