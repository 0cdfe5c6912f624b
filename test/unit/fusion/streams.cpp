#include "streams.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "geometry/euler.h"
#include "geometry/so3.h"
#include "simulation/random.h"

namespace roadfix::test {
namespace {

constexpr double kTiltSigma = 2e-3;  ///< rad

/// Error of a filter in one horizontal direction: position and velocity, corrected by fixes of the position.
struct AxisError {
  Eigen::Vector2d e = Eigen::Vector2d::Zero();  ///< estimate minus truth
  Eigen::Matrix2d P = Eigen::Matrix2d::Zero();

  void walk(double dt, double q_sigma, RandomStream& random) {
    Eigen::Matrix2d F;
    F << 1.0, dt, 0.0, 1.0;
    e = F * e;
    e.y() += q_sigma * std::sqrt(dt) * random.normal();
    P = F * P * F.transpose();
    P(1, 1) += q_sigma * q_sigma * dt;
  }
  void fix(double sigma, double noise) {
    const Eigen::Vector2d K = P.col(0) / (P(0, 0) + sigma * sigma);
    e += K * (noise - e.x());
    P -= K * P.row(0);
  }
};

struct ScalarError {
  double e = 0.0;
  double P = 0.0;
  void walk(double dt, double sigma, RandomStream& random) {
    e += sigma * std::sqrt(dt) * random.normal();
    P += sigma * sigma * dt;
  }
  void fix(double sigma, double noise) {
    const double K = P / (P + sigma * sigma);
    e += K * (noise - e);
    P -= K * P;
  }
};

bool in_outage(const InsNoise& noise, double t_s) {
  return std::any_of(noise.outages.begin(), noise.outages.end(),
                     [&](const Outage& o) { return t_s >= o.begin_s && t_s < o.end_s; });
}

int64_t duration_us(const SimulatedDrive& drive) { return static_cast<int64_t>(drive.config.duration_s * 1e6); }

}  // namespace

std::vector<StreamEvent> ins_stream(const SimulatedDrive& drive, const InsNoise& n, std::uint64_t seed) {
  const auto source = std::make_unique<RandomStream>(seed, 101);  // on the stack GCC 12 calls its spare uninitialised
  RandomStream& random = *source;
  AxisError east, north, up;
  for (AxisError* a : {&east, &north, &up}) {
    a->P.diagonal() << 0.01, 0.01;
    a->e << 0.1 * random.normal(), 0.1 * random.normal();
  }
  ScalarError yaw;
  yaw.P = 1e-5;
  yaw.e = std::sqrt(yaw.P) * random.normal();
  const Eigen::Vector2d tilt(kTiltSigma * random.normal(), kTiltSigma * random.normal());
  std::vector<StreamEvent> events;
  const auto step_us = static_cast<int64_t>(std::llround(1e6 / n.rate_hz));
  const double dt = static_cast<double>(step_us) * 1e-6;
  double next_fix = n.fix_period;
  for (int64_t t_us = step_us; t_us <= duration_us(drive) - step_us; t_us += step_us) {
    const double t_s = static_cast<double>(t_us) * 1e-6;
    for (AxisError* a : {&east, &north, &up}) a->walk(dt, n.velocity_walk, random);
    const double yaw_before = yaw.e;
    yaw.walk(dt, n.yaw_walk, random);
    const double gyro_error = (yaw.e - yaw_before) / dt;
    const bool outage = in_outage(n, t_s);
    if (t_s >= next_fix) {
      next_fix += n.fix_period;
      if (!outage) {
        const Eigen::Vector2d lie = n.lie ? n.lie(t_s) : Eigen::Vector2d::Zero();
        east.fix(n.fix_sigma, n.fix_sigma * random.normal() + lie.x());
        north.fix(n.fix_sigma, n.fix_sigma * random.normal() + lie.y());
        up.fix(n.fix_sigma, n.fix_sigma * random.normal());
        yaw.fix(n.yaw_sigma, n.yaw_sigma * random.normal());
      }
    }
    const Odometry truth = drive.truth_at(drive.config.start_utime + t_us);
    const YawPitchRoll a = yaw_pitch_roll(truth.T_frame_vehicle.q);
    StreamEvent event;
    event.gnss = !outage;
    Odometry& o = event.sample.odometry;
    o = truth;
    o.T_frame_vehicle.p += Eigen::Vector3d(east.e.x(), north.e.x(), up.e.x());
    o.T_frame_vehicle.q = quaternion({a.yaw + yaw.e, a.pitch + tilt.x(), a.roll + tilt.y()});
    o.angular_rate.z() += gyro_error;  // what walks in the yaw came through the gyro
    const Eigen::Vector3d velocity_error(east.e.y(), north.e.y(), up.e.y());
    o.velocity = o.T_frame_vehicle.q.conjugate() * (truth.T_frame_vehicle.q * truth.velocity + velocity_error);
    const double c2 = n.claimed * n.claimed;
    o.cov_pose.diagonal() << east.P(0, 0), north.P(0, 0), up.P(0, 0), kTiltSigma * kTiltSigma, kTiltSigma * kTiltSigma,
        yaw.P;
    o.cov_pose *= c2;
    // Along the vehicle's x: the speed, through which the yaw's error turns nothing to first order.
    o.cov_velocity.diagonal().setConstant(c2 * east.P(1, 1));
    o.validity = outage ? Validity::kCoasting : Validity::kValid;
    event.sample.channel = FusionChannel::kIns;
    event.sample.enu = event.sample.by_velocity = true;
    events.push_back(event);
  }
  return events;
}

std::vector<StreamEvent> vo_stream(const SimulatedDrive& drive, const VoNoise& n, std::uint64_t seed) {
  const auto source = std::make_unique<RandomStream>(seed, 102);
  RandomStream& random = *source;
  const double scale = std::exp(n.scale_std * random.normal()), turns = std::exp(n.turns_std * random.normal());
  std::vector<StreamEvent> events;
  const auto step_us = static_cast<int64_t>(std::llround(1e6 / n.rate_hz));
  Odometry estimate;
  std::optional<Odometry> last;
  for (int64_t t_us = step_us; t_us <= duration_us(drive) - step_us; t_us += step_us) {
    const Odometry truth = drive.truth_at(drive.config.start_utime + t_us);
    if (last) {
      Planar motion = motion_between(planar_pose(*last), planar_pose(truth));
      const double sigma = std::hypot(n.step_sigma, n.step_share * motion.head<2>().norm());
      motion.head<2>() *= scale;
      motion.z() *= turns;
      motion += Planar(sigma * random.normal(), sigma * random.normal(), n.yaw_step * random.normal());
      const double rise = scale * (truth.T_frame_vehicle.p.z() - last->T_frame_vehicle.p.z());
      last = truth;
      if (n.fault && !n.fault(static_cast<double>(t_us) * 1e-6, motion)) continue;
      const Planar from = planar_pose(estimate), to = after_motion(from, motion);
      const Eigen::Matrix3d carry = moved_by(from, motion).by_start;
      Eigen::Matrix3d P = carry * planar_covariance(estimate) * carry.transpose();
      P.diagonal() += Eigen::Vector3d(sigma * sigma, sigma * sigma, n.yaw_step * n.yaw_step);
      estimate.T_frame_vehicle.p << to.x(), to.y(), estimate.T_frame_vehicle.p.z() + rise;
      estimate.T_frame_vehicle.q = quaternion({to.z(), 0.0, 0.0});
      estimate.cov_pose.setZero();
      estimate.cov_pose.topLeftCorner<2, 2>() = P.topLeftCorner<2, 2>();
      estimate.cov_pose.block<2, 1>(0, 5) = P.block<2, 1>(0, 2);
      estimate.cov_pose.block<1, 2>(5, 0) = P.block<1, 2>(2, 0);
      estimate.cov_pose(5, 5) = P(2, 2);
      estimate.cov_pose.diagonal().segment<3>(2) << 1.0, kTiltSigma * kTiltSigma, kTiltSigma * kTiltSigma;
      estimate.velocity = scale * truth.velocity;
      estimate.angular_rate = truth.angular_rate;
      estimate.cov_velocity = 0.01 * Eigen::Matrix3d::Identity();
    }
    last = truth;
    estimate.t_us = truth.t_us;
    estimate.validity = Validity::kValid;
    StreamEvent event;
    event.sample.channel = FusionChannel::kVo;
    event.sample.odometry = estimate;
    events.push_back(event);
  }
  return events;
}

std::vector<StreamEvent> wheel_stream(const SimulatedDrive& drive, VoNoise noise, std::uint64_t seed) {
  noise.turns_std = 1e-3;
  std::vector<StreamEvent> events = vo_stream(drive, noise, seed + 1000);
  for (StreamEvent& e : events) e.sample.channel = FusionChannel::kWheel;
  return events;
}

std::vector<StreamEvent> merged(const std::vector<std::vector<StreamEvent>>& streams) {
  std::vector<StreamEvent> all;
  for (const auto& s : streams) all.insert(all.end(), s.begin(), s.end());
  std::stable_sort(all.begin(), all.end(), [](const StreamEvent& a, const StreamEvent& b) {
    const auto key = [](const StreamEvent& e) { return std::pair(e.sample.odometry.t_us, e.sample.channel); };
    return key(a) < key(b);
  });
  return all;
}

void run(Fusion& fusion, const std::vector<StreamEvent>& events, const OnFused& on_fused) {
  for (const StreamEvent& e : events) {
    if (e.sample.channel == FusionChannel::kIns) fusion.set_gnss(e.sample.odometry.t_us, e.gnss);
    (void)fusion.add(e.sample);
    on_fused(fusion.publish({}), e);
  }
}

PlanarError planar_error(const SimulatedDrive& drive, const Odometry& estimate) {
  PlanarError p;
  p.error = planar_pose(drive.truth_at(estimate.t_us)) - planar_pose(estimate);
  p.error.z() = wrap_angle(p.error.z());
  p.cov = planar_covariance(estimate);
  return p;
}

}  // namespace roadfix::test
