/// The tie between the visual frame and ENU: position, yaw and scale, estimated online while GNSS is good, frozen with
/// growing uncertainty in an outage (MODEL.md, section 6). No reference trajectory is needed.
///
/// p_enu = a + exp(s) Rz(yaw) (p_vo - r), with r the visual position at the last use: the uncertainty of a is that of
/// the car's place, without the lever arm to the visual frame's origin.
#pragma once

#include <Eigen/Dense>

#include "geometry/se3.h"

namespace roadfix {

struct TieNoise {
  double position = 0.02;   ///< m per sqrt(m driven)
  double yaw = 2e-4;        ///< rad per sqrt(m)
  double scale = 1e-4;      ///< per sqrt(m)
  double scale_std = 0.05;  ///< of the first tie
};

template <class Visitor>
void visit(TieNoise& c, Visitor& v) {
  v.number("position_m_per_rtm", c.position, 0.0, 10.0);
  v.number("yaw_rad_per_rtm", c.yaw, 0.0, 1.0);
  v.number("scale_per_rtm", c.scale, 0.0, 1.0);
  v.number("scale_std", c.scale_std, 0.0, 10.0);
}

class FrameTie {
 public:
  enum Index { kPosition = 0, kYaw = 3, kLogScale = 4, kSize = 5 };
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;

  /// Ties the two poses of one moment; cov_enu: of position and yaw (4x4: x, y, z, yaw).
  void start(const SE3& T_vo_vehicle, const SE3& T_enu_vehicle, const Eigen::Matrix4d& cov_enu, const TieNoise& noise);
  void forget() { valid_ = false; }

  /// The visual pose has moved; uncertainty grows with the way.
  void move_to(const SE3& T_vo_vehicle, const TieNoise& noise);
  /// Compares with ENU; the visual pose is that of the last move_to.
  void correct(const SE3& T_vo_vehicle, const SE3& T_enu_vehicle, const Eigen::Matrix4d& cov_enu);

  [[nodiscard]] bool valid() const { return valid_; }
  [[nodiscard]] SE3 to_enu(const SE3& T_vo_vehicle) const;
  [[nodiscard]] double yaw() const { return x_(kYaw); }
  [[nodiscard]] double scale() const;            ///< ENU metres per visual metre
  [[nodiscard]] Eigen::Vector3d origin() const;  ///< of the visual frame, in ENU
  [[nodiscard]] const Vector5d& mean() const { return x_; }
  [[nodiscard]] const Matrix5d& covariance() const { return P_; }

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.valid_, self.reference_, self.x_, self.P_);
  }

 private:
  bool valid_ = false;
  Eigen::Vector3d reference_ = Eigen::Vector3d::Zero();  ///< r
  Vector5d x_ = Vector5d::Zero();
  Matrix5d P_ = Matrix5d::Zero();
};

/// Where a visual pose lies by a tie, and its Jacobian; for move_to and its test.
Eigen::Vector3d tied_position(const FrameTie::Vector5d& x, const Eigen::Vector3d& step_vo);
Eigen::Matrix<double, 3, 5> tied_position_jacobian(const FrameTie::Vector5d& x, const Eigen::Vector3d& step_vo);

}  // namespace roadfix
