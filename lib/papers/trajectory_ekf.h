/// Kim and Kang (2025): a filter on the trajectory of a visual odometry (MODEL.md, section 1).
///
/// LiteralTrajectoryEkf is the paper's: state (x, y), control = the odometry's own displacement, measurement = the
/// odometry's own position. It is the identity: started at the first measurement, every innovation is zero. Kept to
/// show that. MotionTrajectoryEkf has information that the odometry's positions do not have: that a car has inertia.
#pragma once

#include <Eigen/Dense>
#include <optional>

namespace roadfix {

struct LiteralTrajectoryConfig {
  double process_sigma = 0.5;      ///< m, sigma_x = sigma_y: R_t of the paper is this squared
  double measurement_sigma = 1.0;  ///< m, orb_sigma_x = orb_sigma_y: Q_t of the paper
};

class LiteralTrajectoryEkf {
 public:
  explicit LiteralTrajectoryEkf(const LiteralTrajectoryConfig& config) : config_(config) {}

  /// Sets the state apart from the first measurement, with its own covariance.
  void start(const Eigen::Vector2d& mean, const Eigen::Vector2d& measured, double variance);
  /// One frame; the first one starts the filter at the measurement unless start() came before.
  void add(const Eigen::Vector2d& measured);

  [[nodiscard]] const Eigen::Vector2d& position() const { return mean_; }
  [[nodiscard]] double covariance_trace() const { return P_.trace(); }
  /// Of the last frame.
  [[nodiscard]] double innovation_norm() const { return innovation_norm_; }

 private:
  LiteralTrajectoryConfig config_;
  std::optional<Eigen::Vector2d> last_;
  Eigen::Vector2d mean_ = Eigen::Vector2d::Zero();
  Eigen::Matrix2d P_ = Eigen::Matrix2d::Zero();
  double innovation_norm_ = 0.0;
};

struct MotionTrajectoryConfig {
  double position_sigma = 0.1;  ///< m, white error of one position
  double speed_change = 1.5;    ///< m/s2 per sqrt(Hz)
  double turn_change = 0.3;     ///< rad/s2 per sqrt(Hz)
};

/// Constant speed and turn rate with process noise, measuring positions: x, y, course, speed, turn rate.
class MotionTrajectoryEkf {
 public:
  explicit MotionTrajectoryEkf(const MotionTrajectoryConfig& config) : config_(config) {}

  /// Position after `dt` seconds from the last one.
  void add(double dt, const Eigen::Vector2d& measured);

  [[nodiscard]] Eigen::Vector2d position() const { return x_.head<2>(); }
  [[nodiscard]] double covariance_trace() const { return P_.topLeftCorner<2, 2>().trace(); }

 private:
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;

  void start(double dt, const Eigen::Vector2d& measured);
  void predict(double dt);

  MotionTrajectoryConfig config_;
  int count_ = 0;
  Eigen::Vector2d first_ = Eigen::Vector2d::Zero();
  Vector5d x_ = Vector5d::Zero();
  Matrix5d P_ = Matrix5d::Zero();
};

}  // namespace roadfix
