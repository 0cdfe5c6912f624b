#include "features/patch.h"

#include <catch2/catch.hpp>
#include <opencv2/imgproc.hpp>

#include "features/corners.h"
#include "support/pictures.h"

namespace roadfix {
namespace {

/// Root mean square error, px, of where patches are found after the picture was sheared as a road is between the eyes
/// of a stereo pair.
double error_after_shear(double shear, double shape_std) {
  const cv::Mat first = test::texture(640, 240, 21);
  const cv::Matx23d warp(1.0, shear, -120.0 * shear - 3.4, 0.0, 1.0, 0.0);
  cv::Mat second;
  cv::warpAffine(first, second, warp, first.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
  double sum = 0.0;
  int found = 0, tried = 0;
  for (const Corner& corner : spread_corners(first, {}, {})) {
    const auto patch = cut_patch(first, corner.pixel + Eigen::Vector2f(0.3F, -0.2F), 11);
    if (!patch) continue;
    const Eigen::Vector2f point = corner.pixel + Eigen::Vector2f(0.3F, -0.2F);
    const auto x = static_cast<double>(point.x()), y = static_cast<double>(point.y());
    const Eigen::Vector2d truth(x + shear * (y - 120.0) - 3.4, y);
    if (truth.x() < 10.0 || truth.x() > 630.0) continue;
    ++tried;
    Placement start;
    start.centre = (truth + Eigen::Vector2d(0.8, -0.6)).cast<float>();
    const auto place = place_patch(*patch, second, start, {11, 0.6, shape_std});
    if (!place) continue;
    ++found;
    sum += (place->point(*patch).cast<double>() - truth).squaredNorm();
  }
  CHECK(found > 0.9 * tried);
  return std::sqrt(sum / found);
}

TEST_CASE("a sheared patch is found where its point is") {
  CHECK(error_after_shear(0.0, 0.2) < 0.05);
  CHECK(error_after_shear(0.2, 0.2) < 0.06);
  CHECK(error_after_shear(0.2, 0.0) > 0.15);  // teeth: a patch that keeps its shape is pulled aside
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
