#include "navigation/aiding/camera/seen_picture.h"

#include <cmath>

#include "navigation/aiding/camera/common_tracks.h"

namespace roadfix::navigation {

namespace {

// Noise moves a place by a tenth of a pixel: of ten tracks, that nine stay within a hundredth comes once in 1e9 pictures.
constexpr double kSame_px = 0.01;
constexpr double kSameShare = 0.9;

std::optional<EyePoint> eye_point(const Camera& lens, const Eigen::Vector2d& pixel) {
  const auto z = lens.unproject(pixel);
  Eigen::Matrix2d J;
  if (!z || !lens.distort(*z, &J)) return std::nullopt;
  return EyePoint{*z, std::sqrt(std::abs(J.determinant()))};
}

}  // namespace

SeenPicture seen_picture(const TrackPicture& picture, const Camera& left, const Camera* right) {
  SeenPicture seen;
  seen.t_us = picture.t_us;
  seen.points.reserve(picture.tracks.size());
  for (const TrackSighting& s : picture.tracks) {
    const auto point = eye_point(left, s.left);
    if (!point) continue;
    SeenPoint& p = seen.points.emplace_back();
    p.track = s.track;
    p.left = *point;
    if (right != nullptr && s.right) p.right = eye_point(*right, *s.right);
    p.sigma_px = s.sigma_px;
    p.walk_px = s.walk_px;
    p.right_sigma_px = s.right_sigma_px;
  }
  return seen;
}

bool same_picture(const TrackPicture& before, const TrackPicture& now) {
  size_t common = 0, same = 0;
  for_each_common(before.tracks, now.tracks, [&](const TrackSighting& then, const TrackSighting& s) {
    ++common;
    same += (s.left - then.left).norm() < kSame_px ? 1 : 0;
  });
  return common >= kEnoughCommon && static_cast<double>(same) > kSameShare * static_cast<double>(common);
}

}  // namespace roadfix::navigation
