#include <algorithm>
#include <cmath>

#include "simulation/link.h"
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

/// What faults do to one fix.
struct GnssDisturbance {
  GnssError added;
  Eigen::Vector3d added_variance = Eigen::Vector3d::Zero();  ///< m2, of multipath
  double added_velocity_sigma = 0.0;                         ///< m/s
  double noise_factor = 1.0;
  double claim = 1.0;
  double position_latency = 0.0;
  double velocity_latency = 0.0;
  bool multipath = false;
  bool no_velocity = false;
};

Eigen::Vector3d scaled_up_twice(double sigma) { return sigma * Eigen::Vector3d(1.0, 1.0, 2.0); }

/// The fault of multipath: a Gauss-Markov error per fault, begun where the fault begins.
class MultipathFaults {
 public:
  explicit MultipathFaults(double interval_s) : interval_s_(interval_s) {}

  void add(ActiveFault& f, GnssDisturbance& d) {
    auto it = std::find_if(running_.begin(), running_.end(), [&](const Running& r) { return r.fault == f.fault; });
    if (it == running_.end()) {
      running_.push_back({f.fault, GaussMarkov3(1.0, f->get("correlation_s"), {f.random.bits(), 0})});
      it = running_.end() - 1;
    } else {
      it->error.advance(interval_s_);
    }
    const Eigen::Vector3d sigma = scaled_up_twice(f->get("sigma_m"));
    d.added.position += sigma.cwiseProduct(it->error.value());
    d.added_variance += sigma.cwiseAbs2();
    // The Doppler suffers with the pseudoranges, by white noise.
    d.added.velocity += f->get("velocity_sigma_mps") * f.random.normal3();
    d.added_velocity_sigma = std::hypot(d.added_velocity_sigma, f->get("velocity_sigma_mps"));
    d.claim *= f->get("claim");
    d.multipath = true;
  }

 private:
  struct Running {
    const Fault* fault;
    GaussMarkov3 error;
  };
  double interval_s_;
  std::vector<Running> running_;
};

/// The direction is drawn from a copy of the fault's stream, so it is the same at every fix.
Eigen::Vector3d reacquisition_error(const ActiveFault& f, double t_s) {
  RandomStream random = f.random;
  const double azimuth = 2.0 * kPi * random.uniform();
  const double size = f->get("error_m") * std::exp(-(t_s - f->start_s) / f->get("decay_s"));
  return size * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0.5 * random.normal());
}

GnssDisturbance disturbance_at(FaultSet& faults, MultipathFaults& multipath, double t_s) {
  GnssDisturbance d;
  faults.for_each(t_s, [&](ActiveFault& f) {
    switch (f->kind) {
      case FaultKind::kNoise:
        d.noise_factor *= f->get("factor");
        break;
      case FaultKind::kGnssBias:
        d.added.position += Eigen::Vector3d(f->get("east_m"), f->get("north_m"), f->get("up_m"));
        break;
      case FaultKind::kRamp:
        d.added.position +=
            (t_s - f->start_s) * Eigen::Vector3d(f->get("east_mps"), f->get("north_mps"), f->get("up_mps"));
        break;
      case FaultKind::kMultipath:
        multipath.add(f, d);
        break;
      case FaultKind::kReacquire:
        d.added.position += reacquisition_error(f, t_s);
        break;
      case FaultKind::kClaim:
        d.claim *= f->get("factor");
        break;
      case FaultKind::kLatency:
        d.position_latency += f->get("position_s");
        d.velocity_latency += f->get("velocity_s");
        break;
      case FaultKind::kNoVelocity:
        d.no_velocity = true;
        break;
      default:  // those of every sensor are the link's
        break;
    }
  });
  return d;
}

GnssFix measure(const SimulatedDrive& drive, double t_s, const GnssError& error, const GnssDisturbance& d) {
  const GnssConfig& c = drive.config.gnss;
  const Eigen::Vector3d sigma(c.sigma_horizontal_m, c.sigma_horizontal_m, c.sigma_up_m);
  const Eigen::Vector3d variance =
      sigma.cwiseAbs2() + scaled_up_twice(c.multipath_sigma_m).cwiseAbs2() + d.added_variance;
  const double claim = c.claimed_sigma_factor * d.claim;
  const AntennaState antenna = antenna_at(drive, t_s - c.position_latency_s - d.position_latency);
  GnssFix fix;
  fix.fix_type = d.multipath ? FixType::kSingle : c.fix_type;
  fix.antenna = drive.anchor.geodetic(antenna.p_enu + antenna.R_anchor_here * error.position);
  fix.cov_enu = (claim * claim * variance).asDiagonal();
  if (c.sigma_velocity_mps > 0.0 && !d.no_velocity) {
    const double claimed = claim * std::hypot(c.sigma_velocity_mps, d.added_velocity_sigma);
    const AntennaState then = antenna_at(drive, t_s - c.velocity_latency_s - d.velocity_latency);
    fix.velocity = GnssVelocity{then.velocity + error.velocity, Eigen::Matrix3d::Identity() * claimed * claimed};
  }
  return fix;
}

/// Heading of the vehicle's x axis, clockwise from true north at the antenna, as two antennas on it measure it.
GnssHeading measure_heading(const SimulatedDrive& drive, double t_s, double error, double claim) {
  const AntennaState antenna = antenna_at(drive, t_s);
  const Eigen::Vector3d forward = drive.motion->at(t_s).T_enu_vehicle.q * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d here = antenna.R_anchor_here.transpose() * forward;
  const double heading = std::atan2(here.x(), here.y()) + error;
  return {heading < 0.0 ? heading + 2.0 * kPi : heading, claim * drive.config.gnss.sigma_heading_rad};
}

}  // namespace

void simulate_gnss(SimulatedDrive& drive) {
  const GnssConfig& c = drive.config.gnss;
  RandomStream position_noise = stream_of(drive, NoiseStream::kGnssPosition);
  RandomStream velocity_noise = stream_of(drive, NoiseStream::kGnssVelocity);
  RandomStream heading_noise = stream_of(drive, NoiseStream::kGnssHeading);
  GaussMarkov3 multipath(1.0, c.multipath_correlation_s, stream_of(drive, NoiseStream::kGnssMultipath));
  drive.errors.gnss_lever_arm =
      c.lever_arm_m + c.lever_arm_std_m * stream_of(drive, NoiseStream::kGnssLeverArm).normal3();
  if (c.rate_hz <= 0.0) return;
  FaultSet faults(drive, Sensor::kGnss);
  MultipathFaults multipath_faults(1.0 / c.rate_hz);
  const Eigen::Vector3d sigma(c.sigma_horizontal_m, c.sigma_horizontal_m, c.sigma_up_m);
  for (const std::int64_t t_us : sample_times(c.rate_hz, c.phase_s, drive.config.duration_s)) {
    const double t_s = seconds_between(0, t_us);
    const GnssDisturbance d = disturbance_at(faults, multipath_faults, t_s);
    GnssError error;
    error.position = d.noise_factor * sigma.cwiseProduct(position_noise.normal3()) +
                     scaled_up_twice(c.multipath_sigma_m).cwiseProduct(multipath.value()) + d.added.position;
    error.velocity = d.noise_factor * c.sigma_velocity_mps * velocity_noise.normal3() + d.added.velocity;
    multipath.advance(1.0 / c.rate_hz);
    drive.gnss.push_back(measure(drive, t_s, error, d));
    if (c.sigma_heading_rad > 0.0) {
      error.heading = d.noise_factor * c.sigma_heading_rad * heading_noise.normal();
      drive.gnss.back().heading = measure_heading(drive, t_s, error.heading, c.claimed_sigma_factor * d.claim);
    }
    drive.gnss.back().t_us = drive.config.start_utime + t_us;
    drive.errors.gnss.push_back(error);
  }
  deliver(drive, Sensor::kGnss, c.link, drive.gnss, &drive.errors.gnss, drive.deliveries.gnss);
}

}  // namespace roadfix
