/// Tracks into VO_FEATURES and out again.
#include "bus/track_codec.h"

#include <catch2/catch.hpp>
#include <limits>

namespace roadfix {
namespace {

TrackSighting sighting(int64_t track) {
  return {.track = track, .left = {10.25, 20.5}, .right = {}, .sigma_px = 0.125, .walk_px = 0.25};
}

TEST_CASE("tracks come out of a message as they went in") {
  vo_features2_t message{};
  message.utime = 77;
  append(sighting(3), vo_features2_t::USE_NEW, message);
  TrackSighting both = sighting(8);
  both.right = Eigen::Vector2d(7.75, 20.25);
  both.right_sigma_px = 0.5;
  append(both, vo_features2_t::USE_INLIER, message);
  REQUIRE(message.num_features == 2);
  const TrackPicture picture = track_picture(message);
  CHECK(picture.t_us == 77);
  REQUIRE(picture.tracks.size() == 2);
  CHECK(picture.tracks[0].track == 3);
  CHECK(picture.tracks[0].left == Eigen::Vector2d(10.25, 20.5));
  CHECK_FALSE(picture.tracks[0].right);
  CHECK(picture.tracks[1].sigma_px == 0.125);
  CHECK(picture.tracks[1].walk_px == 0.25);
  REQUIRE(picture.tracks[1].right);
  CHECK(*picture.tracks[1].right == Eigen::Vector2d(7.75, 20.25));
  CHECK(picture.tracks[1].right_sigma_px == 0.5);
}

TEST_CASE("what is no measurement is left out of the tracks, its neighbours stay") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  vo_features2_t good{};
  for (const int64_t track : {1, 2, 3}) append(sighting(track), vo_features2_t::USE_MATCHED, good);
  good.right[1] = vo_features2_t::RIGHT_SEEN;
  good.right_sigma_px[1] = 0.5F;
  REQUIRE(track_picture(good).tracks.size() == 3);
  const auto kept_without_second = [&good](auto spoil) {
    vo_features2_t bad = good;
    spoil(bad);
    const TrackPicture picture = track_picture(bad);
    return picture.tracks.size() == 2 && picture.tracks[0].track == 1 && picture.tracks[1].track == 3;
  };
  CHECK(kept_without_second([](auto& m) { m.u_px[1] = kNan; }));
  CHECK(kept_without_second([](auto& m) { m.sigma_px[1] = 0.0F; }));
  CHECK(kept_without_second([](auto& m) { m.walk_px[1] = -0.1F; }));
  CHECK(kept_without_second([](auto& m) { m.right_v_px[1] = kNan; }));
  CHECK(kept_without_second([](auto& m) { m.right_sigma_px[1] = 0.0F; }));
  CHECK(kept_without_second([](auto& m) { m.track_id[1] = 1; }));
}

}  // namespace
}  // namespace roadfix
