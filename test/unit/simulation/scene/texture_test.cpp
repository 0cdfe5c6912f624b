/// Does what is painted on a face lie in the same place from near and from afar?
#include "simulation/scene/texture.h"

#include <catch2/catch.hpp>
#include <cstdio>

namespace roadfix {
namespace {

constexpr float kFine_m = 0.005F, kBegin_m = 2.0F;
constexpr int kSteps = 12000;                                      // 60 m, less than a block
constexpr float kLong_m = 2.0F, kHigh_m = 1.0F, kJoint_m = 0.03F;  // a tunnel's stones

/// Albedo every kFine_m along one direction, at some place across, averaged over `width` along it.
std::vector<double> profile(Material material, Pattern pattern, bool along_t, float across, float width) {
  std::vector<double> out;
  out.reserve(kSteps);
  for (int i = 0; i < kSteps; i += kLanes) {
    SurfaceLanes p{};
    p.material += static_cast<std::int32_t>(material);
    p.pattern += static_cast<std::int32_t>(pattern);
    p.key += 77U;
    p.tint = splat(1.0F);
    p.pattern_s = splat(kLong_m);
    p.pattern_t = splat(kHigh_m);
    F8& along = along_t ? p.t : p.s;
    (along_t ? p.s : p.t) = splat(across);
    for (int k = 0; k < kLanes; ++k) along[k] = kBegin_m + kFine_m * static_cast<float>(i + k);
    (along_t ? p.width_t : p.width_s) = splat(width);
    (along_t ? p.width_s : p.width_t) = splat(kFine_m);
    const F8 a = albedo(p);
    for (int k = 0; k < kLanes; ++k) out.push_back(static_cast<double>(a[k]));
  }
  return out;
}

/// How much of what lies near the joints between stones a footprint of `width` sees on their near side, over what it
/// sees on their far side: one where it sees all of a joint from both sides.
double near_over_far(bool along_t, float width) {
  const float pattern = along_t ? kHigh_m : kLong_m;
  double near = 0.0, far = 0.0;
  for (const float across : {3.3F, 5.7F, 9.2F, 12.6F, 17.3F, 21.9F}) {
    const std::vector<double> seen = profile(Material::kTunnelWall, Pattern::kCourses, along_t, across, width);
    for (float joint = kBegin_m + pattern; joint < kBegin_m + kSteps * kFine_m - pattern; joint += pattern) {
      const auto at = [&](float x) { return seen[static_cast<size_t>(std::lround((x - kBegin_m) / kFine_m))]; };
      const float middle = joint + 0.5F * kJoint_m;
      near += at(middle - 1.5F * width) - at(middle - 0.3F * width);
      far += at(middle + 1.5F * width) - at(middle + 0.3F * width);
    }
  }
  return near / far;
}

TEST_CASE("the joints of a wall seen from afar are as dark on one side as on the other") {
  for (const bool along_t : {false, true}) {
    for (const float width : {0.06F, 0.1F, 0.16F}) {
      const double ratio = near_over_far(along_t, width);
      std::printf("joints %s, footprint %.2f m: %.2f times as dark before as behind\n", along_t ? "level" : "upright",
                  width, ratio);
      CHECK(ratio == Approx(1.0).margin(0.15));
    }
  }
}

TEST_CASE("grain seen from afar has no edge sharper than the footprint") {
  // Rectangles of 0.10 and 0.10 that reach the footprint (and half as much again), smooth noise of 0.13 in all.
  constexpr double kContrast = 1.5 * 0.2 + 2.0 * 0.13;
  double steepest = 0.0;  // share of the contrast, per share of the footprint
  for (const bool along_t : {false, true}) {
    for (const float width : {0.06F, 0.1F, 0.16F}) {
      for (const float across : {3.3F, 5.7F, 9.2F, 12.6F, 17.3F, 21.9F}) {
        const auto seen = profile(Material::kConcrete, Pattern::kNone, along_t, across, width);
        for (size_t i = 1; i < seen.size(); ++i) {
          steepest =
              std::max(steepest, std::abs(seen[i] - seen[i - 1]) / kContrast * static_cast<double>(width / kFine_m));
        }
      }
    }
  }
  std::printf("grain: steepest step %.2f of the contrast over a footprint\n", steepest);
  CHECK(steepest < 1.0);
}

}  // namespace
}  // namespace roadfix
