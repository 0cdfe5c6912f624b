#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "features/corners.h"
#include "features/front_end.h"
#include "support/pictures.h"

namespace roadfix {
namespace {

using test::shifted;
using test::texture;

TEST_CASE("corners are distributed, separated and away from those taken") {
  const cv::Mat image = texture(640, 240, 3);
  const std::vector<Eigen::Vector2f> taken{{320.0F, 120.0F}};
  CornerConfig config;
  config.max_corners = 150;
  config.min_distance_px = 20.0;
  const auto corners = spread_corners(image, taken, config);
  REQUIRE(corners.size() > 100);
  REQUIRE(corners.size() <= 150);
  std::set<int> quarters;
  for (size_t i = 0; i < corners.size(); ++i) {
    REQUIRE((corners[i].pixel - taken[0]).norm() >= 20.0F);
    for (size_t j = 0; j < i; ++j) REQUIRE((corners[i].pixel - corners[j].pixel).norm() >= 20.0F);
    quarters.insert(static_cast<int>(corners[i].pixel.x() / 160.0F));
  }
  CHECK(quarters.size() == 4);
  CHECK(spread_corners(cv::Mat::zeros(240, 640, CV_8UC1), {}, config).empty());
  CHECK(spread_corners(cv::Mat::zeros(5, 5, CV_8UC1), {}, config).empty());
}

TEST_CASE("a small image has the same number of corners, closer together") {
  CornerConfig config;
  config.max_corners = 350;
  const cv::Mat quarter = texture(310, 94, 3);
  const auto corners = spread_corners(quarter, {}, config);
  CHECK(corners.size() > 200);  // 16 px apart there would be room for some 70, on a regular grid for some 110
  const double room_px = 0.7 * std::sqrt(310.0 * 94.0 / 350.0);
  for (size_t i = 0; i < corners.size(); ++i) {
    for (size_t j = 0; j < i; ++j) REQUIRE((corners[i].pixel - corners[j].pixel).norm() >= room_px);
  }
}

TEST_CASE("optical flow tracks a moving image under constant track numbers") {
  const auto front_end = make_front_end({});
  const cv::Mat first = texture(640, 240, 5);
  CHECK(front_end->track(first, {}).empty());
  std::map<int64_t, Eigen::Vector2f> begun;
  for (const Feature& f : front_end->replenish()) begun[f.track] = f.pixel;
  REQUIRE(begun.size() > 150);
  const auto found = front_end->track(shifted(first, 7.25, -3.5), {});
  CHECK(front_end->num_expected() == static_cast<int>(begun.size()));
  REQUIRE(found.size() > begun.size() * 8 / 10);
  int exact = 0;
  for (const Feature& f : found) {
    exact += (f.pixel - begun.at(f.track) - Eigen::Vector2f(7.25F, -3.5F)).norm() < 0.2F ? 1 : 0;
  }
  CHECK(exact > static_cast<int>(found.size()) * 95 / 100);
}

TEST_CASE("a prediction finds what flow alone cannot") {
  const cv::Mat first = texture(640, 240, 8, 4), second = shifted(first, 90.0, 0.0);
  const auto found_share = [&](bool has_prediction) {
    FrontEndConfig config;
    config.klt_levels = 1;
    const auto front_end = make_front_end(config);
    (void)front_end->track(first, {});
    std::vector<Feature> predictions = front_end->replenish();
    const auto begun = predictions;
    for (Feature& f : predictions) f.pixel.x() += 88.0F;
    const auto found = front_end->track(second, has_prediction ? predictions : std::vector<Feature>{});
    int good = 0;
    for (const Feature& f : found) {
      for (const Feature& b : begun) {
        if (b.track == f.track && (f.pixel - b.pixel - Eigen::Vector2f(90.0F, 0.0F)).norm() < 0.5F) ++good;
      }
    }
    return static_cast<double>(good) / static_cast<double>(begun.size());
  };
  CHECK(found_share(true) > 0.6);
  CHECK(found_share(false) < 0.1);
}

/// Share of the tracks found within 0.2 px after a shift with changed intensities.
double share_after_exposure(double gain, double offset) {
  const auto front_end = make_front_end({});
  const cv::Mat first = texture(640, 240, 5);
  (void)front_end->track(first, {});
  std::map<int64_t, Eigen::Vector2f> begun;
  for (const Feature& f : front_end->replenish()) begun[f.track] = f.pixel;
  cv::Mat second;
  shifted(first, 2.25, -1.5).convertTo(second, CV_8UC1, gain, offset);
  int exact = 0;
  for (const Feature& f : front_end->track(second, {})) {
    exact += (f.pixel - begun.at(f.track) - Eigen::Vector2f(2.25F, -1.5F)).norm() < 0.2F ? 1 : 0;
  }
  return static_cast<double>(exact) / static_cast<double>(begun.size());
}

TEST_CASE("an exposure change loses no tracks, saturation does") {
  CHECK(share_after_exposure(1.0, 0.0) > 0.9);
  CHECK(share_after_exposure(0.4, 0.0) > 0.9);
  CHECK(share_after_exposure(0.5, 80.0) > 0.9);
  CHECK(share_after_exposure(8.0, 0.0) < 0.2);  // teeth: mostly white
}

TEST_CASE("dropped tracks end, new ones get new numbers, black images end all") {
  const auto front_end = make_front_end({});
  const cv::Mat image = texture(640, 240, 5);
  (void)front_end->track(image, {});
  const auto begun = front_end->replenish();
  const std::vector<int64_t> dropped{begun[0].track, begun[1].track};
  front_end->drop(dropped);
  for (const Feature& f : front_end->track(image, {})) REQUIRE(f.track > dropped[1]);
  for (const Feature& f : front_end->replenish()) REQUIRE(f.track > begun.back().track);
  CHECK(front_end->track(cv::Mat::zeros(240, 640, CV_8UC1), {}).empty());
  CHECK(front_end->track(texture(320, 120, 5), {}).empty());  // different size
}

}  // namespace
}  // namespace roadfix
