#include "simulation/motion.h"

#include <cmath>
#include <stdexcept>

#include "geometry/euler.h"

namespace roadfix {
namespace {

constexpr int kOrder = 6;  // control points that count at one time

/// Values of the six quintic basis functions at x in [0, 1) and their first two derivatives by x (columns).
Eigen::Matrix<double, kOrder, 3> basis(double x) {
  // Row i: coefficients of x^0 .. x^5 of the i-th basis function, times 120 (uniform quintic B-spline).
  static constexpr double kCoefficients[kOrder][kOrder] = {{1, -5, 10, -10, 5, -1},  {26, -50, 20, 20, -20, 5},
                                                           {66, 0, -60, 0, 30, -10}, {26, 50, 20, -20, -20, 10},
                                                           {1, 5, 10, 10, 5, -5},    {0, 0, 0, 0, 0, 1}};
  Eigen::Matrix<double, kOrder, 3> b;
  for (int i = 0; i < kOrder; ++i) {
    const double* c = kCoefficients[i];
    b(i, 0) = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))));
    b(i, 1) = c[1] + x * (2.0 * c[2] + x * (3.0 * c[3] + x * (4.0 * c[4] + x * 5.0 * c[5])));
    b(i, 2) = 2.0 * c[2] + x * (6.0 * c[3] + x * (12.0 * c[4] + x * 20.0 * c[5]));
  }
  return b / 120.0;
}

/// Control points whose spline reproduces every polynomial up to the fifth degree from its samples
/// (quasi-interpolation; weights from the moment conditions of the quintic B-spline).
std::vector<PoseCoordinates> control_points(const std::vector<PoseCoordinates>& f) {
  std::vector<PoseCoordinates> c;
  c.reserve(f.size() - 4);
  for (std::size_t i = 2; i + 2 < f.size(); ++i) {
    // Written with differences, so that equal samples give exactly their value.
    const PoseCoordinates far = (f[i - 2] - f[i]) + (f[i + 2] - f[i]);
    const PoseCoordinates near = (f[i - 1] - f[i]) + (f[i + 1] - f[i]);
    c.emplace_back(f[i] + (13.0 * far - 112.0 * near) / 240.0);
  }
  return c;
}

/// Angular rate and acceleration in vehicle axes from the angles (columns: value, first, second derivative; rows: yaw,
/// pitch, roll).
void set_rotation(const Eigen::Matrix3d& angles, Kinematics& k) {
  const double sp = std::sin(angles(1, 0));
  const double cp = std::cos(angles(1, 0));
  const double sr = std::sin(angles(2, 0));
  const double cr = std::cos(angles(2, 0));
  const double yaw1 = angles(0, 1);
  const double pitch1 = angles(1, 1);
  const double roll1 = angles(2, 1);
  const double yaw2 = angles(0, 2);
  const double pitch2 = angles(1, 2);
  const double roll2 = angles(2, 2);
  k.T_enu_vehicle.q = quaternion({angles(0, 0), angles(1, 0), angles(2, 0)});
  k.angular_rate = {roll1 - yaw1 * sp, pitch1 * cr + yaw1 * cp * sr, -pitch1 * sr + yaw1 * cp * cr};
  k.angular_acceleration = {
      roll2 - yaw2 * sp - yaw1 * pitch1 * cp,
      pitch2 * cr - pitch1 * roll1 * sr + yaw2 * cp * sr - yaw1 * pitch1 * sp * sr + yaw1 * roll1 * cp * cr,
      -pitch2 * sr - pitch1 * roll1 * cr + yaw2 * cp * cr - yaw1 * pitch1 * sp * cr - yaw1 * roll1 * cp * sr};
}

}  // namespace

Motion::Motion(double first_s, double step_s, const std::vector<PoseCoordinates>& samples) : step_s_(step_s) {
  if (samples.size() < 11) throw std::invalid_argument("simulation: a motion needs at least eleven samples");
  control_ = control_points(samples);
  begin_s_ = first_s + 4.0 * step_s;
  end_s_ = begin_s_ + static_cast<double>(control_.size() - 5) * step_s;
}

Kinematics Motion::at(double t_s) const {
  if (!(t_s >= begin_s_ && t_s <= end_s_)) throw std::out_of_range("simulation: time outside of the motion");
  const double knots = (t_s - begin_s_) / step_s_;
  const auto last = control_.size() - kOrder;
  const auto first = std::min(static_cast<std::size_t>(knots), last);
  const Eigen::Matrix<double, kOrder, 3> b = basis(knots - static_cast<double>(first));
  // Offsets from the first control point: equal points give exactly zero motion, and metres far from the anchor lose no
  // digits of the derivatives.
  const PoseCoordinates& origin = control_[first];
  Eigen::Matrix<double, 6, 3> value = Eigen::Matrix<double, 6, 3>::Zero();
  for (int i = 1; i < kOrder; ++i) {
    const PoseCoordinates offset = control_[first + static_cast<std::size_t>(i)] - origin;
    value += offset * b.row(i);
  }
  value.col(0) += origin;
  value.col(1) /= step_s_;
  value.col(2) /= step_s_ * step_s_;
  Kinematics k;
  k.T_enu_vehicle.p = value.block<3, 1>(0, 0);
  k.velocity_enu = value.block<3, 1>(0, 1);
  k.acceleration_enu = value.block<3, 1>(0, 2);
  set_rotation(value.bottomRows<3>(), k);
  return k;
}

}  // namespace roadfix
