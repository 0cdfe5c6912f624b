/// Alignment of a small template patch with another image, to hundredths of a pixel.
///
/// Inverse compositional Gauss-Newton (Baker and Matthews, Lucas-Kanade 20 years on, 2004) over translation and,
/// optionally, affine shape (four parameters with a prior about their start). Gain and offset of the intensities are
/// projected out (Hager and Belhumeur, 1998), so that exposure may change between images. Without the shape, a patch on
/// the road that comes nearer is biased towards its strongest texture. Plain loops in a fixed order, no OpenCV: the
/// same bits on every machine of one build.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace roadfix {

inline constexpr int kMaxPatchWindow = 31;

struct PatchConfig {
  int window_px = 11;                ///< odd, at most kMaxPatchWindow
  double min_correlation = 0.8;      ///< with the template
  double shape_std = 0.1;            ///< prior sigma of each shape parameter; zero: translation only
  float max_displacement_px = 0.0F;  ///< from the start, on either axis; zero: half the window
};

/// Centred on a whole pixel, so that nothing is interpolated; the offset gives the position of the point.
struct Patch {
  std::vector<uint8_t> grey;                         ///< rows of window + 2 pixels: one pixel of border for the
                                                     ///< gradient
  Eigen::Vector2f offset = Eigen::Vector2f::Zero();  ///< of the point from the centre
};

/// Alignment of a patch with an image: x from the patch's centre maps to centre + shape * x.
struct PatchAlignment {
  Eigen::Vector2f centre = Eigen::Vector2f::Zero();
  Eigen::Matrix2f shape = Eigen::Matrix2f::Identity();
  float correlation = 0.0F;

  [[nodiscard]] Eigen::Vector2f point(const Patch& patch) const { return centre + shape * patch.offset; }
};

/// Second order of a warp in the template's pixels: x goes to shape * (x + bend * (x x, x y, y y)).
using PatchBend = Eigen::Matrix<float, 2, 3>;

/// Precomputed terms of the template for N unknowns: translation, or translation and shape.
template <int N>
struct PatchModel {
  int count = 0;              ///< pixels; zero: not computed yet
  bool flat = false;          ///< too little texture
  std::vector<float> pixels;  ///< zero-mean intensities, then their N derivatives; each padded with zeros
  float energy = 0.0F;        ///< squared norm of the intensities
  Eigen::Matrix<float, N, N> inverse = Eigen::Matrix<float, N, N>::Zero();  ///< inverse Gauss-Newton matrix, prior
                                                                            ///< included
  /// Template pixels by which alignment without the second order moves the centre, per element of the bend (column by
  /// column): depends on where in the window the texture is.
  Eigen::Matrix<float, 2, 6> per_bend = Eigen::Matrix<float, 2, 6>::Zero();

  [[nodiscard]] Eigen::Vector2f shift(const PatchBend& bend) const {
    return per_bend * Eigen::Map<const Eigen::Matrix<float, 6, 1>>(bend.data());
  }
};

/// No value where the window is not within the image.
std::optional<Patch> extract_patch(const cv::Mat& gray, const Eigen::Vector2f& pixel, int window_px);

/// No value where the patch has too little texture, leaves the image or does not reach the correlation.
std::optional<PatchAlignment> align_patch(const Patch& patch, const cv::Mat& gray, const PatchAlignment& start,
                                          const PatchConfig& config);
/// The same with affine shape; `model` is computed at the first call and valid while patch and configuration (except
/// max_displacement_px) are unchanged.
std::optional<PatchAlignment> align_patch(const Patch& patch, PatchModel<6>& model, const cv::Mat& gray,
                                          const PatchAlignment& start, const PatchConfig& config);

}  // namespace roadfix
