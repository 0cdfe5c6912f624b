#include "pose_server/nmea_pose.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "bus/sample_codec.h"
#include "evaluation/trajectory.h"
#include "geodesy/enu_anchor.h"
#include "geometry/frames.h"

namespace roadfix {

namespace {

/// A course is sent where the speed is this many of its sigmas: below, it is the direction of noise.
constexpr double kCourseSigmas = 3.0;
constexpr double kSlowest_mps = 0.1;

/// A pose farther from its anchor than the Earth is wide is none.
constexpr double kEarth_m = 1.3e7;

double clockwise_from_north_deg(double east, double north) { return std::atan2(east, north) / kDegree; }

/// `cov`: m2 in local east, north, up.
NmeaDeviations deviations(const Eigen::Matrix3d& cov) {
  const Eigen::Matrix2d horizontal = cov.topLeftCorner<2, 2>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(horizontal);
  const Eigen::Vector2d axis = solver.eigenvectors().col(1);
  NmeaDeviations d;
  d.minor_m = std::sqrt(std::max(solver.eigenvalues()(0), 0.0));
  d.major_m = std::sqrt(std::max(solver.eigenvalues()(1), 0.0));
  d.orientation_deg = clockwise_from_north_deg(axis.x(), axis.y());
  if (d.orientation_deg < 0.0) d.orientation_deg += 180.0;  // an axis has no sense: [0, 180]
  d.lon_m = std::sqrt(std::max(cov(0, 0), 0.0));
  d.lat_m = std::sqrt(std::max(cov(1, 1), 0.0));
  d.height_m = std::sqrt(std::max(cov(2, 2), 0.0));
  return d;
}

bool possible(const Odometry& pose) {
  return pose.T_frame_vehicle.p.allFinite() && pose.T_frame_vehicle.p.cwiseAbs().maxCoeff() < kEarth_m &&
         pose.T_frame_vehicle.R().allFinite() && pose.velocity.allFinite() && pose.angular_rate.allFinite();
}

void set_height(double height, const FixFacts& fix, const GeoidModel* geoid, NmeaPose& out) {
  if (fix.height_kind == HeightKind::kMeanSeaLevel) {
    out.height_msl_m = height;
    return;
  }
  if (fix.height_kind != HeightKind::kEllipsoid || geoid == nullptr) return;
  out.geoid_separation_m = geoid->separation_m(out.position->lat_deg, out.position->lon_deg);
  if (out.geoid_separation_m) out.height_msl_m = height - *out.geoid_separation_m;
}

}  // namespace

NmeaQuality quality_of(FixType type) {
  switch (type) {
    case FixType::kSingle:
      return NmeaQuality::kSingle;
    case FixType::kDifferential:
      return NmeaQuality::kDifferential;
    case FixType::kRtkFloat:
      return NmeaQuality::kRtkFloat;
    case FixType::kRtkFixed:
      return NmeaQuality::kRtkFixed;
    case FixType::kNone:
    case FixType::kDeadReckoning:
      return NmeaQuality::kDeadReckoning;
  }
  return NmeaQuality::kDeadReckoning;
}

NmeaPose nmea_pose(const pose_t& message, const FixFacts& fix, const Eigen::Vector3d& point, const GeoidModel* geoid) {
  NmeaPose out;
  out.t_us = message.utime;
  const Odometry pose = at_lever_arm(odometry(message), point);
  if (pose.validity == Validity::kInvalid || message.frame != pose_t::FRAME_ENU ||
      message.scale != pose_t::SCALE_METRIC || !possible(pose)) {
    return out;
  }
  const EnuAnchor anchor({message.anchor_lat_deg * kDegree, message.anchor_lon_deg * kDegree, message.anchor_height_m});
  const Geodetic place = anchor.geodetic(pose.T_frame_vehicle.p);
  if (!std::isfinite(place.latitude) || !std::isfinite(place.longitude) || !std::isfinite(place.height)) return out;
  out.position = NmeaPosition{place.latitude / kDegree, place.longitude / kDegree};
  out.quality = pose.validity == Validity::kValid ? fix.quality : NmeaQuality::kDeadReckoning;
  out.num_satellites = fix.num_satellites;
  out.correction_age_s = fix.correction_age_s;
  set_height(place.height, fix, geoid, out);

  // North where the vehicle is, not at the anchor: they differ by the meridians' convergence.
  const Eigen::Matrix3d R_here_anchor = anchor.R_anchor_enu_at(place).transpose();
  const Eigen::Matrix3d R_here_vehicle = R_here_anchor * pose.T_frame_vehicle.R();
  const Eigen::Vector3d ahead = R_here_vehicle.col(0), velocity = R_here_vehicle * pose.velocity;
  out.heading_deg = clockwise_from_north_deg(ahead.x(), ahead.y());
  const double speed = velocity.head<2>().norm();
  out.speed_mps = speed;
  const double sigma = std::sqrt(std::max(pose.cov_velocity.topLeftCorner<2, 2>().trace(), 0.0));
  if (speed > std::max(kSlowest_mps, kCourseSigmas * sigma))
    out.course_deg = clockwise_from_north_deg(velocity.x(), velocity.y());
  const Eigen::Matrix3d cov = pose.cov_pose.topLeftCorner<3, 3>();
  if (cov.allFinite()) out.deviations = deviations(R_here_anchor * cov * R_here_anchor.transpose());
  return out;
}

}  // namespace roadfix
