/// Normal equations of a bundle adjustment and their Schur complement: points are eliminated, cameras and lens remain.
/// MODEL.md (S.7.7)-(S.7.10).
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "slam/reprojection.h"

namespace roadfix {

/// Unknowns: six for each free view, then the lens correction, then three for each point.
class NormalEquations {
 public:
  /// `num_observations`: upper bound.
  NormalEquations(int num_free_views, size_t num_points, size_t num_observations = 0);

  /// Weight of an observation: slope of its robust cost in b, curvature in H.
  struct Weight {
    double slope = 1.0;
    double curvature = 1.0;
    double score_curvature = 0.0;  ///< of the track's cost: weight of its squared score, subtracted from H, (S.7.13)
  };

  /// One observation, residual and derivatives already divided by sigma; `free_view` is -1 for a fixed one.
  /// Observations come in ascending order of point, then of view.
  void add(int free_view, size_t point, const ReprojectionJacobian& J, const Eigen::Vector2d& residual, Weight weight);

  /// A residual on the positions of two views; either may be fixed (-1).
  void add_distance(int free_a, int free_b, const Eigen::Vector3d& J_b, double residual);

  /// A residual on the poses of two views; either may be fixed (-1), and free_a is the earlier one.
  void add_relative_pose(int free_a, int free_b, const Matrix6d& J_a, const Matrix6d& J_b, const Vector6d& residual);

  /// Prior of the lens correction.
  void add_lens_prior(const LensCorrection::Matrix& information, const LensCorrection::Vector& residual);

  struct Step {
    Eigen::VectorXd views;
    LensCorrection::Vector lens;
    std::vector<Eigen::Vector3d> points;
  };
  /// Levenberg-Marquardt step: diagonal times (1 + damping).
  [[nodiscard]] Step solve(double damping) const;

  /// Inverse of the reduced system: covariance of views and lens, points marginalised, (S.7.11).
  [[nodiscard]] Eigen::MatrixXd covariance() const;

  /// The same for errors of unknown size that are correlated along a track and independent between tracks: the score of
  /// each point is one sample (Liang and Zeger 1986, cluster sandwich), (S.9.2). `covariance`: from covariance().
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
    LensCorrection::Vector b_lens = LensCorrection::Vector::Zero();  ///< its part of the lens's right-hand side
    double score_curvature = 0.0;
    size_t links_end = 0;  ///< end of its links; they start at the previous point's end
  };
  struct Reduced {
    Eigen::MatrixXd S;  ///< lower triangle
    Eigen::VectorXd s;
    std::vector<Eigen::Matrix3d> inverse_H;  ///< per point, damped
  };
  [[nodiscard]] Reduced reduce(double damping) const;
  /// Adds the outer product of every point's score, times `factor(point)`, to a lower triangle; returns the number of
  /// points.
  template <class Factor>
  size_t add_scores(Eigen::MatrixXd& lower, Factor factor) const;

  int lens_row_;
  Eigen::MatrixXd H_;  ///< of views and lens, lower triangle
  Eigen::VectorXd b_;
  Eigen::MatrixXd H_prior_;  ///< contribution of distances and priors to H_, lower triangle
  std::vector<Point> points_;
  std::vector<Link> links_;
};

}  // namespace roadfix
