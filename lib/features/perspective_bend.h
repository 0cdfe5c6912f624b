/// The second order of a slanted plane's motion, which an affine patch leaves out.
///
/// Between two pictures a plane moves by a homography; an affine patch is its first order. The second order moves the
/// aligned patch off its point: a wall beside the car grows faster on its near side, so that the patch is ahead of the
/// point. The pull is alike for all tracks of one wall and greater on the nearer wall; the difference between the sides
/// looks like a turn of the camera (lib/slam/EVIDENCE.md).
///
/// The homography needs no depth. With t the camera's direction of travel in its own axes, d = t_xy - m t_z the
/// direction in which normalised coordinates m of the present picture move, and r the gradient of inverse depth in the
/// template's picture, a plane's affine part and denominator are
///   A = G (I + d r'),   m' = m + A x / (1 + g' x),   g = t_z G r,
/// where G, the growth across d, and r follow from the aligned shape A alone:
///   G = n' A n with n across d,   r' = d' (A / G - I) / |d|^2.
/// The rotation between the pictures adds a second order of its own, in a turn of 0.03 rad a picture a tenth of a near
/// wall's and the same on both sides: neglected.
#pragma once

#include <Eigen/Dense>
#include <optional>

#include "camera/camera.h"
#include "features/patch.h"

namespace roadfix {

class PerspectiveBend {
 public:
  /// `travel`: the camera's direction of travel in camera axes, forwards or backwards.
  PerspectiveBend(const Camera& camera, const Eigen::Vector3d& travel)
      : camera_(camera), travel_(travel.normalized()) {}

  /// The second order of the plane's warp from the template's picture to the present one, the lens included. `shape`:
  /// its first order, as aligned. Zero where the lens has no such pixels.
  [[nodiscard]] PatchBend of(const Eigen::Vector2d& template_pixel, const Eigen::Vector2d& pixel,
                             const Eigen::Matrix2d& shape) const;

 private:
  Camera camera_;
  Eigen::Vector3d travel_;
};

}  // namespace roadfix
