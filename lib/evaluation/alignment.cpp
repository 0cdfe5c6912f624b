#include "evaluation/alignment.h"

#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

/// Share of the largest singular value below which a direction counts as not observed.
constexpr double kRankTolerance = 1e-9;

struct Moments {
  Eigen::Vector3d mean_estimate = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_reference = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();  ///< mean of (r - mean_r)(e - mean_e)'
  double variance_estimate = 0.0;                   ///< mean of |e - mean_e|^2
};

Moments moments(const std::vector<PosePair>& pairs) {
  Moments m;
  const double n = static_cast<double>(pairs.size());
  for (const PosePair& pair : pairs) {
    m.mean_estimate += pair.estimate.T_frame_vehicle.p / n;
    m.mean_reference += pair.reference.T_frame_vehicle.p / n;
  }
  for (const PosePair& pair : pairs) {
    const Eigen::Vector3d e = pair.estimate.T_frame_vehicle.p - m.mean_estimate;
    const Eigen::Vector3d r = pair.reference.T_frame_vehicle.p - m.mean_reference;
    m.cross += r * e.transpose() / n;
    m.variance_estimate += e.squaredNorm() / n;
  }
  return m;
}

Similarity about_means(const Moments& m, const Eigen::Matrix3d& R, double scale) {
  Similarity S;
  S.scale = scale;
  S.T.q = Eigen::Quaterniond(R).normalized();
  S.T.p = m.mean_reference - scale * (R * m.mean_estimate);
  return S;
}

std::optional<Similarity> align_yaw(const Moments& m) {
  const double cosine = m.cross(0, 0) + m.cross(1, 1);
  const double sine = m.cross(1, 0) - m.cross(0, 1);
  if (std::hypot(cosine, sine) <= kRankTolerance * m.variance_estimate) return std::nullopt;
  return about_means(m, exp_so3(Eigen::Vector3d(0.0, 0.0, std::atan2(sine, cosine))), 1.0);
}

/// (E.1.1): Umeyama 1991, equations (40) to (43).
std::optional<Similarity> align_umeyama(const Moments& m, bool with_scale) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m.cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& d = svd.singularValues();
  if (d(1) <= kRankTolerance * d(0)) return std::nullopt;
  Eigen::Vector3d s = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) s(2) = -1.0;
  const Eigen::Matrix3d R = svd.matrixU() * s.asDiagonal() * svd.matrixV().transpose();
  const double scale = with_scale ? d.dot(s) / m.variance_estimate : 1.0;
  return about_means(m, R, scale);
}

}  // namespace

const char* name_of(Alignment alignment) {
  switch (alignment) {
    case Alignment::kNone:
      return "none";
    case Alignment::kYaw:
      return "yaw";
    case Alignment::kSe3:
      return "se3";
    case Alignment::kSim3:
      return "sim3";
    case Alignment::kTied:
      return "tied";
  }
  return "none";
}

std::optional<Similarity> align(const std::vector<PosePair>& pairs, Alignment alignment) {
  if (alignment == Alignment::kNone) return Similarity{};
  if (pairs.size() < 3 || alignment == Alignment::kTied) return std::nullopt;
  const Moments m = moments(pairs);
  if (!(m.variance_estimate > 0.0)) return std::nullopt;
  if (alignment == Alignment::kYaw) return align_yaw(m);
  return align_umeyama(m, alignment == Alignment::kSim3);
}

namespace {

Similarity rotated_onto(const PosePair& pair, double yaw) {
  Similarity S;
  S.T.q = exp_q(Eigen::Vector3d(0.0, 0.0, yaw));
  S.T.p = pair.reference.T_frame_vehicle.p - S.T.q * pair.estimate.T_frame_vehicle.p;
  return S;
}

}  // namespace

Similarity tie(const PosePair& pair) {
  return rotated_onto(pair, yaw_between(pair.estimate.T_frame_vehicle.q, pair.reference.T_frame_vehicle.q));
}

Similarity tie_by_displacement(const PosePair& from, const PosePair& to) {
  const auto direction = [](const Odometry& a, const Odometry& b) {
    const Eigen::Vector3d displacement = b.T_frame_vehicle.p - a.T_frame_vehicle.p;
    return std::atan2(displacement.y(), displacement.x());
  };
  return rotated_onto(from, direction(from.reference, to.reference) - direction(from.estimate, to.estimate));
}

Odometry transformed(const Similarity& S, const Odometry& pose) {
  Odometry out = pose;
  out.T_frame_vehicle.p = S.scale * (S.T.q * pose.T_frame_vehicle.p) + S.T.p;
  out.T_frame_vehicle.q = S.T.q * pose.T_frame_vehicle.q;
  out.velocity = S.scale * pose.velocity;
  Matrix6d J = Matrix6d::Identity();
  J.block<3, 3>(0, 0) = S.scale * S.T.R();
  out.cov_pose = J * pose.cov_pose * J.transpose();
  out.cov_velocity = S.scale * S.scale * pose.cov_velocity;
  return out;
}

}  // namespace roadfix
