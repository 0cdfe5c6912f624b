/// A small patch of one picture found again in another, to hundredths of a pixel.
///
/// Inverse compositional Gauss-Newton (Baker and Matthews, Lucas-Kanade 20 years on, 2004): place and, where asked for,
/// shape (the four numbers of an affine map, held near their start by a prior). Gain and offset of the grey levels are
/// projected out (Hager and Belhumeur, 1998), so that a camera's exposure may change from picture to picture.
/// A patch that keeps its shape while the road in it comes nearer is pulled to where its texture is strongest.
/// Plain loops in a fixed order, no OpenCV: the same bits on every machine of one build.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace roadfix {

inline constexpr int kMaxPatchWindow = 31;

struct PatchConfig {
  int window_px = 11;            ///< odd, at most kMaxPatchWindow
  double min_correlation = 0.8;  ///< with the patch as it was first seen
  double shape_std = 0.1;        ///< of each number of the shape, about the start's; zero: the shape is known
  float reach_px = 0.0F;         ///< from the start, on either axis; beyond is another thing. Zero: the window's size
};

/// Centred on a whole pixel, so that nothing is interpolated; the point it stands for lies beside the centre.
struct Patch {
  std::vector<uint8_t> grey;                         ///< rows of window + 2 pixels: the border is for the gradient
  Eigen::Vector2f offset = Eigen::Vector2f::Zero();  ///< of the point from the centre
};

/// How a patch lies in a picture: what was `x` from its centre is seen at centre + shape * x.
struct Placement {
  Eigen::Vector2f centre = Eigen::Vector2f::Zero();
  Eigen::Matrix2f shape = Eigen::Matrix2f::Identity();
  float correlation = 0.0F;

  [[nodiscard]] Eigen::Vector2f point(const Patch& patch) const { return centre + shape * patch.offset; }
};

/// What placing a patch needs of the patch alone, with N unknowns: the place, or the place and the shape.
template <int N>
struct PatchModel {
  int count = 0;              ///< pixels; zero: not made yet
  bool flat = false;          ///< too flat to be placed
  std::vector<float> pixels;  ///< the patch without its mean, then its N derivatives; each padded with zeros
  float energy = 0.0F;        ///< squared sum of the first
  Eigen::Matrix<float, N, N> inverse = Eigen::Matrix<float, N, N>::Zero();  ///< of Gauss-Newton's matrix with the prior
};

/// Nothing where the window does not lie within the picture.
std::optional<Patch> cut_patch(const cv::Mat& gray, const Eigen::Vector2f& pixel, int window_px);

/// Nothing where the patch is too flat, leaves the picture or is not found alike.
std::optional<Placement> place_patch(const Patch& patch, const cv::Mat& gray, const Placement& start,
                                     const PatchConfig& config);
/// The same with the shape looked for; `model` is made at the first call and serves as long as patch and configuration
/// (but for its reach) stay.
std::optional<Placement> place_patch(const Patch& patch, PatchModel<6>& model, const cv::Mat& gray,
                                     const Placement& start, const PatchConfig& config);

}  // namespace roadfix
