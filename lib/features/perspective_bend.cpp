#include "features/perspective_bend.h"

namespace roadfix {
namespace {

constexpr double kReach_px = 4.0;      ///< of the second difference
constexpr double kMinDistance = 0.05;  ///< normalised, from the focus of expansion: nearer to it nothing is slanted by
                                       ///< the motion
constexpr double kMinDenominator = 0.5;  ///< present over former depth within the reach; below it the shape is none of
                                         ///< a plane

/// Gradient of inverse depth, normalised, times the length travelled; see the header.
struct Slant {
  double growth = 1.0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
};

std::optional<Slant> slant_of(const Eigen::Matrix2d& A, const Eigen::Vector2d& direction) {
  const Eigen::Vector2d across = Eigen::Vector2d(-direction.y(), direction.x()).normalized();
  const double growth = across.dot(A * across);
  if (!(growth > 0.0)) return std::nullopt;
  const double square = direction.squaredNorm() + kMinDistance * kMinDistance;
  const Eigen::Matrix2d M = A / growth - Eigen::Matrix2d::Identity();
  return Slant{growth, M.transpose() * direction / square};
}

}  // namespace

PatchBend PerspectiveBend::of(const Eigen::Vector2d& template_pixel, const Eigen::Vector2d& pixel,
                              const Eigen::Matrix2d& shape) const {
  const PatchBend none = PatchBend::Zero();
  const auto before = camera_.unproject(template_pixel), now = camera_.unproject(pixel);
  Eigen::Matrix2d J_before, J_now;
  if (!before || !now || !camera_.distort(*before, &J_before) || !camera_.distort(*now, &J_now)) return none;
  const Eigen::Matrix2d A = J_now.inverse() * shape * J_before;
  const Eigen::Vector2d direction = travel_.head<2>() - *now * travel_.z();
  const auto slant = slant_of(A, direction);
  if (!slant) return none;
  const Eigen::Vector2d g = travel_.z() * slant->growth * slant->gradient;
  Eigen::Matrix<double, 2, 3> second;  // second differences along u, the diagonal, v
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector2d reach(k < 2 ? kReach_px : 0.0, k > 0 ? kReach_px : 0.0);
    second.col(k) = -2.0 * pixel;
    for (const double sign : {-1.0, 1.0}) {
      const auto beside = camera_.unproject(template_pixel + sign * reach);
      if (!beside) return none;
      const Eigen::Vector2d x = *beside - *before;
      const double denominator = 1.0 + g.dot(x);
      if (!(denominator > kMinDenominator)) return none;
      const auto there = camera_.distort(*now + A * x / denominator);
      if (!there) return none;
      second.col(k) += *there;
    }
  }
  second.col(1) -= second.col(0) + second.col(2);
  const PatchBend bend = (0.5 / (kReach_px * kReach_px) * shape.inverse() * second).cast<float>();
  return bend.allFinite() ? bend : none;
}

}  // namespace roadfix
