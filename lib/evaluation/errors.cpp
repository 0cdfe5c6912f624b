#include "evaluation/errors.h"

#include <cmath>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

namespace {

constexpr double kSteepest = 60.0 * kDegree;  // of a road vehicle's pitch, by far

bool is_steep(const Eigen::Quaterniond& q) { return std::abs(yaw_pitch_roll(q).pitch) > kSteepest; }

/// PoseError::angles.
Eigen::Vector3d angles_between(const Eigen::Quaterniond& reference, const Eigen::Quaterniond& estimate) {
  if (is_steep(reference)) return log_q(estimate * reference.conjugate());
  const YawPitchRoll a = yaw_pitch_roll(estimate);
  const YawPitchRoll b = yaw_pitch_roll(reference);
  return {wrap_angle(a.roll - b.roll), wrap_angle(a.pitch - b.pitch), wrap_angle(a.yaw - b.yaw)};
}

}  // namespace

Eigen::Matrix3d R_angles_vehicle(const Eigen::Quaterniond& reference) {
  return is_steep(reference) ? reference.toRotationMatrix() : Eigen::Matrix3d::Identity();
}

PoseError pose_error(const PosePair& pair, const ReferenceKind& kind) {
  const SE3& estimate = pair.estimate.T_frame_vehicle;
  const SE3& reference = pair.reference.T_frame_vehicle;
  PoseError e;
  e.t_us = pair.reference.t_us;
  e.validity = pair.estimate.validity;
  e.position_frame = estimate.p - reference.p;
  const Eigen::Quaterniond q_frame_vehicle = kind.attitude ? reference.q : estimate.q;
  e.position_vehicle = q_frame_vehicle.conjugate() * e.position_frame;
  if (kind.attitude) {
    e.angles = angles_between(reference.q, estimate.q);
    e.rotation = log_q(reference.q.conjugate() * estimate.q);
  }
  if (kind.velocity) {
    const Eigen::Vector3d& v = pair.estimate.velocity;
    e.velocity = (kind.attitude ? v : Eigen::Vector3d(estimate.q * v)) - pair.reference.velocity;
  }
  return e;
}

std::vector<PoseError> pose_errors(const std::vector<PosePair>& pairs, const ReferenceKind& kind) {
  std::vector<PoseError> errors;
  errors.reserve(pairs.size());
  for (const PosePair& pair : pairs) errors.push_back(pose_error(pair, kind));
  return errors;
}

AxisErrors axis_errors(const std::vector<PoseError>& errors, const ReferenceKind& kind) {
  const auto summary = [&](auto&& value) {
    std::vector<double> values;
    values.reserve(errors.size());
    for (const PoseError& e : errors) values.push_back(value(e));
    return summarise(values);
  };
  AxisErrors out;
  out.horizontal = summary([](const PoseError& e) { return e.horizontal(); });
  out.norm = summary([](const PoseError& e) { return e.norm(); });
  out.longitudinal = summary([](const PoseError& e) { return e.position_vehicle.x(); });
  out.lateral = summary([](const PoseError& e) { return e.position_vehicle.y(); });
  out.vertical = summary([](const PoseError& e) { return e.position_vehicle.z(); });
  if (kind.attitude) {
    out.roll = summary([](const PoseError& e) { return e.angles.x(); });
    out.pitch = summary([](const PoseError& e) { return e.angles.y(); });
    out.yaw = summary([](const PoseError& e) { return e.angles.z(); });
  }
  if (kind.velocity) out.speed = summary([](const PoseError& e) { return e.velocity.norm(); });
  return out;
}

}  // namespace roadfix
