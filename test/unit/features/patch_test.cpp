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

/// What theory says of a patch around (u, v) whose picture is seen again sheared and with grey noise.
struct Expected {
  double noise2 = 0.0;  ///< px^2, smallest mean square error of its place: Cramer and Rao's bound, shape and grey
                        ///< levels unknown, the shape's prior included
  double pull2 = 0.0;   ///< px^2, of the place where it fits best when it keeps its shape
};

Expected expected(const cv::Mat& picture, int u, int v, double shear, double noise) {
  using Vector8d = Eigen::Matrix<double, 8, 1>;
  constexpr int kHalf = kWindow / 2;
  Eigen::Matrix<double, 8, 8> H = Eigen::Matrix<double, 8, 8>::Zero();
  Vector8d sheared = Vector8d::Zero();
  const auto grey = [&](int x, int y) { return static_cast<double>(picture.at<uint8_t>(v + y, u + x)); };
  for (int y = -kHalf; y <= kHalf; ++y) {
    for (int x = -kHalf; x <= kHalf; ++x) {
      const double gx = 0.5 * (grey(x + 1, y) - grey(x - 1, y)), gy = 0.5 * (grey(x, y + 1) - grey(x, y - 1));
      Vector8d J;  // place, shape, gain, offset
      J << gx, gy, gx * x, gx * y, gy * x, gy * y, grey(x, y), 1.0;
      H += J * J.transpose() / (noise * noise);
      sheared += J * (gx * shear * y) / (noise * noise);
    }
  }
  // Keeping its shape: the shear's change of grey levels is explained by place, gain and offset as well as it goes.
  const Eigen::Matrix<int, 4, 1> known{0, 1, 6, 7};
  const Eigen::Vector4d pull = H(known, known).ldlt().solve(sheared(known));
  for (int i = 2; i < 6; ++i) H(i, i) += 1.0 / (kShapeStd * kShapeStd);
  const Eigen::Matrix2d cov = H.inverse().topLeftCorner<2, 2>();
  const Eigen::Matrix2d A = (Eigen::Matrix2d() << 1.0, shear, 0.0, 1.0).finished();
  return {(A * cov * A.transpose()).trace(), pull.head<2>().squaredNorm()};
}

/// Root mean square error, px, of where patches are found after the picture was sheared as a road is between the eyes
/// of a stereo pair, and what theory says of it.
struct Sheared {
  double error = 0.0, bound = 0.0, pull = 0.0;
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
    const auto patch = cut_patch(first, point, kWindow);
    if (!patch) continue;
    const auto x = static_cast<double>(point.x()), y = static_cast<double>(point.y());
    const Eigen::Vector2d truth(x + shear * (y - 120.0) - 3.4, y);
    if (truth.x() < 10.0 || truth.x() > 630.0) continue;
    ++tried;
    Placement start;
    start.centre = (truth + Eigen::Vector2d(0.8, -0.6)).cast<float>();
    const auto place = place_patch(*patch, second, start, {kWindow, 0.6, shape_std});
    if (!place) continue;
    ++found;
    sum.error += (place->point(*patch).cast<double>() - truth).squaredNorm();
    const Expected e =
        expected(first, static_cast<int>(corner.pixel.x()), static_cast<int>(corner.pixel.y()), shear, noise);
    sum.bound += e.noise2;
    sum.pull += e.pull2;
  }
  CHECK(found > 0.9 * tried);
  return {std::sqrt(sum.error / found), std::sqrt(sum.bound / found), std::sqrt(sum.pull / found)};
}

TEST_CASE("a patch is found as well as its texture and the noise allow, sheared or not") {
  constexpr double kNoise = 8.0;  // grey levels, so much that it outweighs what interpolation does
  for (const double shear : {0.0, 0.2}) {
    const Sheared s = after_shear(shear, kShapeStd, kNoise);
    CAPTURE(shear, s.error, s.bound);
    CHECK(s.error > 0.9 * s.bound);   // nothing is better; 250 patches leave 3 % uncertain
    CHECK(s.error < 1.15 * s.bound);  // first order, and the gradients are differences
  }
  // Teeth: a patch that keeps its shape is pulled aside, by as much as its texture says.
  const Sheared stiff = after_shear(0.2, 0.0, kNoise);
  CAPTURE(stiff.error, stiff.bound, stiff.pull);
  CHECK(stiff.error > 1.3 * stiff.bound);
  CHECK(stiff.error == Approx(std::hypot(stiff.bound, stiff.pull)).epsilon(0.15));
}

TEST_CASE("most patches of another picture are refused") {
  const cv::Mat picture = test::texture(640, 240, 21), other = test::texture(640, 240, 22);
  int tried = 0, found = 0;
  for (const Corner& corner : spread_corners(picture, {}, {})) {
    const auto patch = cut_patch(picture, corner.pixel, 11);
    if (!patch) continue;
    ++tried;
    Placement start;
    start.centre = corner.pixel;
    found += place_patch(*patch, other, start, {}) ? 1 : 0;
  }
  CHECK(4 * found < tried);  // grains of half a window leave few numbers to disagree
}

TEST_CASE("patches stay within the picture, flat ones and others are refused") {
  const cv::Mat picture = test::texture(64, 64, 3);
  CHECK_FALSE(cut_patch(picture, {5.0F, 30.0F}, 11));
  CHECK_FALSE(cut_patch(picture, {30.0F, 58.6F}, 11));
  CHECK_FALSE(cut_patch(picture, {std::nanf(""), 30.0F}, 11));
  const auto patch = cut_patch(picture, {30.4F, 29.7F}, 11);
  REQUIRE(patch);
  CHECK(patch->offset.isApprox(Eigen::Vector2f(0.4F, -0.3F), 1e-5F));
  Placement start;
  start.centre = {30.0F, 30.0F};
  const auto same = place_patch(*patch, picture, start, {});
  REQUIRE(same);
  CHECK((same->centre - start.centre).norm() < 1e-3F);
  CHECK(same->correlation > 0.999F);
  CHECK_FALSE(place_patch(*patch, cv::Mat::zeros(64, 64, CV_8UC1), start, {}));
  start.centre = {2.0F, 30.0F};
  CHECK_FALSE(place_patch(*patch, picture, start, {}));
  const auto flat = cut_patch(cv::Mat::zeros(64, 64, CV_8UC1), {30.0F, 30.0F}, 11);
  start.centre = {30.0F, 30.0F};
  CHECK_FALSE(place_patch(*flat, picture, start, {}));
}

}  // namespace
}  // namespace roadfix
