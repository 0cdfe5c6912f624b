/// Gauss-Newton's normal equations of a bundle adjustment and their reduction: points out, cameras and lens stay.
/// MODEL.md (M.9)-(M.12).
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "slam/reprojection.h"

namespace roadfix {

/// Unknowns: six for each free view, then the lens correction, then three for each point.
class NormalEquations {
 public:
  /// `num_observations`: as many as will be added, at most.
  NormalEquations(int num_free_views, size_t num_points, size_t num_observations = 0);

  /// How much one observation counts: by the slope of its robust cost in b, by its curvature in H.
  struct Weight {
    double slope = 1.0;
    double curvature = 1.0;
    double bend = 0.0;  ///< of the whole point's cost, by which its squared score is less in H, (M.13b)
  };

  /// One observation, residual and derivatives already divided by sigma; `free_view` is -1 for a fixed one.
  /// Observations come in ascending order of point, then of view.
  void add(int free_view, size_t point, const ReprojectionJacobian& J, const Eigen::Vector2d& residual, Weight weight);

  /// A residual on the positions of two views; either may be fixed (-1).
  void add_distance(int free_a, int free_b, const Eigen::Vector3d& J_b, double residual);

  /// A residual on the poses of two views; either may be fixed (-1), and free_a is the earlier one.
  void add_tie(int free_a, int free_b, const Matrix6d& J_a, const Matrix6d& J_b, const Vector6d& residual);

  /// What is known of the lens beforehand.
  void add_lens_prior(const LensCorrection::Matrix& information, const LensCorrection::Vector& residual);

  struct Step {
    Eigen::VectorXd views;
    LensCorrection::Vector lens;
    std::vector<Eigen::Vector3d> points;
  };
  /// Levenberg and Marquardt's step: diagonal times (1 + damping).
  [[nodiscard]] Step solve(double damping) const;

  /// Inverse of the reduced system: covariance of views and lens, points marginalised, (M.13).
  [[nodiscard]] Eigen::MatrixXd covariance() const;

  /// The same where the errors of one point's sightings are alike and of unknown size, but those of different points
  /// are not: the score of each point counts as one draw (Liang and Zeger 1986, the sandwich over clusters), (M.16).
  /// `covariance`: what covariance() gave.
  [[nodiscard]] Eigen::MatrixXd clustered_covariance(const Eigen::MatrixXd& covariance) const;

 private:
  using Matrix63d = Eigen::Matrix<double, 6, 3>;
  using MatrixL3d = Eigen::Matrix<double, LensCorrection::kSize, 3>;

  struct Link {  ///< between a view and a point
    int free_view = 0;
    Matrix63d W;
    Vector6d b;  ///< the point's share of the view's right-hand side
  };
  struct Point {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    MatrixL3d W_lens = MatrixL3d::Zero();
    LensCorrection::Vector b_lens = LensCorrection::Vector::Zero();  ///< its share of the lens's
    double bend = 0.0;
    size_t links_end = 0;  ///< its links end here, and begin where the point before has its end
  };
  struct Reduced {
    Eigen::MatrixXd S;  ///< lower triangle
    Eigen::VectorXd s;
    std::vector<Eigen::Matrix3d> inverse_H;  ///< per point, damped
  };
  [[nodiscard]] Reduced reduce(double damping) const;
  /// Adds the outer product of every point's score, times `factor(point)`, to a lower triangle; returns their number.
  template <class Factor>
  size_t add_scores(Eigen::MatrixXd& lower, Factor factor) const;

  int lens_row_;
  Eigen::MatrixXd H_;  ///< of views and lens, lower triangle
  Eigen::VectorXd b_;
  Eigen::MatrixXd H_known_;  ///< the part of H_ that comes from distances and priors, lower triangle
  std::vector<Point> points_;
  std::vector<Link> links_;
};

}  // namespace roadfix
