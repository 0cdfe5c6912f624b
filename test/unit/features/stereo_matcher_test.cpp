#include "features/stereo_matcher.h"

#include <catch2/catch.hpp>

#include "features/corners.h"
#include "support/pictures.h"

namespace roadfix {
namespace {

const CameraIntrinsics kLens{640, 240, 400.0, 400.0, 320.0, 120.0, Distortion::kNone, {}};

/// Share of the corners of a fronto-parallel wall whose right pixel is found within 0.25 px.
double matched_share(double depth_m, std::optional<double> depth_known) {
  const double baseline = 0.5;
  const double disparity = kLens.fx * baseline / depth_m;
  const cv::Mat left = test::texture(640, 240, 11), right = test::shifted(left, -disparity, 0.0);
  SE3 T_right_left;
  T_right_left.p.x() = -baseline;
  const StereoMatcher matcher(Camera{kLens}, Camera{kLens}, T_right_left, {});
  std::vector<StereoQuery> queries;
  for (const Corner& corner : spread_corners(left, {}, {})) {
    if (corner.pixel.x() > disparity + 20.0) queries.push_back({corner.pixel, depth_known});
  }
  const auto matches = matcher.match(left, right, queries);
  int good = 0;
  for (size_t i = 0; i < queries.size(); ++i) {
    if (!matches[i]) continue;
    const Eigen::Vector2d error = matches[i]->cast<double>() - queries[i].pixel.cast<double>();
    good += (error - Eigen::Vector2d(-disparity, 0.0)).norm() < 0.25 ? 1 : 0;
  }
  return static_cast<double>(good) / static_cast<double>(queries.size());
}

TEST_CASE("stereo matches near and far walls without known depth") {
  CHECK(matched_share(2.5, {}) > 0.9);
  CHECK(matched_share(10.0, {}) > 0.9);
  CHECK(matched_share(300.0, {}) > 0.9);
}

TEST_CASE("a known depth is used, and a wrong one fails") {
  CHECK(matched_share(5.0, 5.2) > 0.9);
  CHECK(matched_share(2.5, 50.0) < 0.2);
}

TEST_CASE("unrelated images give few matches") {
  SE3 T_right_left;
  T_right_left.p.x() = -0.5;
  const StereoMatcher matcher(Camera{kLens}, Camera{kLens}, T_right_left, {});
  const cv::Mat left = test::texture(640, 240, 11), other = test::texture(640, 240, 12);
  std::vector<StereoQuery> queries;
  for (const Corner& corner : spread_corners(left, {}, {})) queries.push_back({corner.pixel, {}});
  int found = 0;
  for (const auto& match : matcher.match(left, other, queries)) found += match ? 1 : 0;
  CHECK(found < static_cast<int>(queries.size()) / 5);
}

}  // namespace
}  // namespace roadfix
