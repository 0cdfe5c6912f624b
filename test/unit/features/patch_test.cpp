#include "features/patch.h"

#include <catch2/catch.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "features/corners.h"
#include "support/pictures.h"

namespace roadfix {
namespace {

constexpr int kWindow = 11;
constexpr double kShapeStd = 0.2;

/// Theoretical accuracy for a patch around (u, v) observed again with shear and intensity noise.
struct Expected {
  double noise2 = 0.0;  ///< px^2, Cramer-Rao bound of the position error, shape and intensities unknown, shape prior
                        ///< levels unknown, the shape's prior included
  double bias2 = 0.0;   ///< px^2, bias of the best position without shape
};

Expected expected(const cv::Mat& image, int u, int v, double shear, double noise) {
  using Vector8d = Eigen::Matrix<double, 8, 1>;
  constexpr int kHalf = kWindow / 2;
  Eigen::Matrix<double, 8, 8> H = Eigen::Matrix<double, 8, 8>::Zero();
  Vector8d sheared = Vector8d::Zero();
  const auto grey = [&](int x, int y) { return static_cast<double>(image.at<uint8_t>(v + y, u + x)); };
  for (int y = -kHalf; y <= kHalf; ++y) {
    for (int x = -kHalf; x <= kHalf; ++x) {
      const double gx = 0.5 * (grey(x + 1, y) - grey(x - 1, y)), gy = 0.5 * (grey(x, y + 1) - grey(x, y - 1));
      Vector8d J;  // position, shape, gain, offset
      J << gx, gy, gx * x, gx * y, gy * x, gy * y, grey(x, y), 1.0;
      H += J * J.transpose() / (noise * noise);
      sheared += J * (gx * shear * y) / (noise * noise);
    }
  }
  // Without shape: the shear's intensity change is explained by position, gain and offset as far as possible.
  const Eigen::Matrix<int, 4, 1> known{0, 1, 6, 7};
  const Eigen::Vector4d bias = H(known, known).ldlt().solve(sheared(known));
  for (int i = 2; i < 6; ++i) H(i, i) += 1.0 / (kShapeStd * kShapeStd);
  const Eigen::Matrix2d cov = H.inverse().topLeftCorner<2, 2>();
  const Eigen::Matrix2d A = (Eigen::Matrix2d() << 1.0, shear, 0.0, 1.0).finished();
  return {(A * cov * A.transpose()).trace(), bias.head<2>().squaredNorm()};
}

/// RMS position error, px, after shearing an image as a road is between the cameras of a stereo pair, with its
/// theoretical bound.
struct Sheared {
  double error = 0.0, bound = 0.0, bias = 0.0;
};

Sheared after_shear(double shear, double shape_std, double noise) {
  const cv::Mat first = test::texture(640, 240, 21);
  const cv::Matx23d warp(1.0, shear, -120.0 * shear - 3.4, 0.0, 1.0, 0.0);
  cv::Mat second;
  cv::warpAffine(first, second, warp, first.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
  std::mt19937 random(5);
  std::normal_distribution<double> grain(0.0, noise);
  for (int i = 0; i < static_cast<int>(second.total()); ++i) {
    second.data[i] = cv::saturate_cast<uint8_t>(second.data[i] + grain(random));
  }
  Sheared sum;
  int found = 0, tried = 0;
  for (const Corner& corner : spread_corners(first, {}, {})) {
    const Eigen::Vector2f point = corner.pixel + Eigen::Vector2f(0.3F, -0.2F);
    const auto patch = extract_patch(first, point, kWindow);
    if (!patch) continue;
    const auto x = static_cast<double>(point.x()), y = static_cast<double>(point.y());
    const Eigen::Vector2d truth(x + shear * (y - 120.0) - 3.4, y);
    if (truth.x() < 10.0 || truth.x() > 630.0) continue;
    ++tried;
    PatchAlignment start;
    start.centre = (truth + Eigen::Vector2d(0.8, -0.6)).cast<float>();
    const auto place = align_patch(*patch, second, start, {kWindow, 0.6, shape_std});
    if (!place) continue;
    ++found;
    sum.error += (place->point(*patch).cast<double>() - truth).squaredNorm();
    const Expected e =
        expected(first, static_cast<int>(corner.pixel.x()), static_cast<int>(corner.pixel.y()), shear, noise);
    sum.bound += e.noise2;
    sum.bias += e.bias2;
  }
  CHECK(found > 0.9 * tried);
  return {std::sqrt(sum.error / found), std::sqrt(sum.bound / found), std::sqrt(sum.bias / found)};
}

TEST_CASE("patch alignment reaches the Cramer-Rao bound, with and without shear") {
  constexpr double kNoise = 8.0;  // grey levels, large enough to dominate interpolation errors
  for (const double shear : {0.0, 0.2}) {
    const Sheared s = after_shear(shear, kShapeStd, kNoise);
    CAPTURE(shear, s.error, s.bound);
    CHECK(s.error > 0.9 * s.bound);   // the bound; 250 patches have 3 % uncertainty
    CHECK(s.error < 1.15 * s.bound);  // first-order theory, gradients by differences
  }
  // Teeth: a patch without shape is biased as its texture predicts.
  const Sheared stiff = after_shear(0.2, 0.0, kNoise);
  CAPTURE(stiff.error, stiff.bound, stiff.bias);
  CHECK(stiff.error > 1.3 * stiff.bound);
  CHECK(stiff.error == Approx(std::hypot(stiff.bound, stiff.bias)).epsilon(0.15));
}

TEST_CASE("most patches of an unrelated image are rejected") {
  const cv::Mat image = test::texture(640, 240, 21), other = test::texture(640, 240, 22);
  int tried = 0, found = 0;
  for (const Corner& corner : spread_corners(image, {}, {})) {
    const auto patch = extract_patch(image, corner.pixel, 11);
    if (!patch) continue;
    ++tried;
    PatchAlignment start;
    start.centre = corner.pixel;
    found += align_patch(*patch, other, start, {}) ? 1 : 0;
  }
  CHECK(4 * found < tried);  // coarse texture leaves few degrees of freedom
}

TEST_CASE("patches stay within the image, flat and unrelated ones are rejected") {
  const cv::Mat image = test::texture(64, 64, 3);
  CHECK_FALSE(extract_patch(image, {5.0F, 30.0F}, 11));
  CHECK_FALSE(extract_patch(image, {30.0F, 58.6F}, 11));
  CHECK_FALSE(extract_patch(image, {std::nanf(""), 30.0F}, 11));
  const auto patch = extract_patch(image, {30.4F, 29.7F}, 11);
  REQUIRE(patch);
  CHECK(patch->offset.isApprox(Eigen::Vector2f(0.4F, -0.3F), 1e-5F));
  PatchAlignment start;
  start.centre = {30.0F, 30.0F};
  const auto same = align_patch(*patch, image, start, {});
  REQUIRE(same);
  CHECK((same->centre - start.centre).norm() < 1e-3F);
  CHECK(same->correlation > 0.999F);
  CHECK_FALSE(align_patch(*patch, cv::Mat::zeros(64, 64, CV_8UC1), start, {}));
  start.centre = {2.0F, 30.0F};
  CHECK_FALSE(align_patch(*patch, image, start, {}));
  const auto flat = extract_patch(cv::Mat::zeros(64, 64, CV_8UC1), {30.0F, 30.0F}, 11);
  start.centre = {30.0F, 30.0F};
  CHECK_FALSE(align_patch(*flat, image, start, {}));
}

}  // namespace
}  // namespace roadfix
