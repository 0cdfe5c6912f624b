// Does it stand? The picture's witness must know its own noise.
#include <catch2/catch.hpp>

#include "msckf/standing.h"
#include "simulation/random.h"

using namespace roadfix;
using namespace roadfix::msckf;

namespace {

constexpr double kFocal = 440.0;  // px
constexpr int64_t kImuPeriodUs = 10'000;
constexpr int64_t kFramePeriodUs = 100'000;

/// Quiet imu, `tracks` points that drift to the right at `speed` px/s, seen with `noise` px.
struct Scene {
  int tracks = 60;
  double noise = 0.5;
  double speed = 0.0;
  double seconds = 20.0;
};

/// Share of the pictures of the last three quarters in which it is told to stand.
double share_standing(const Scene& scene, uint64_t seed, const MsckfTrust& trust = {}) {
  RandomStream random(seed, 0x57A);
  Standing standing(trust);
  const ImuSample still{0, {1e-4, 0.0, 0.0}, {0.0, 0.0, 9.8}};
  int stands = 0, asked = 0;
  const auto end_us = static_cast<int64_t>(1e6 * scene.seconds);
  for (int64_t t = kImuPeriodUs; t < end_us; t += kImuPeriodUs) {
    ImuSample imu = still;
    imu.t_us = t;
    standing.add(imu, 1e-6 * static_cast<double>(kImuPeriodUs));
    if (t % kFramePeriodUs != 0) continue;
    SeenFrame frame;
    frame.t_us = t;
    for (int i = 0; i < scene.tracks; ++i) {
      const Eigen::Vector2d px(scene.speed * 1e-6 * static_cast<double>(t), 3.0 * i);
      const double u = random.normal(), v = random.normal();
      frame.points.push_back({i, (px + scene.noise * Eigen::Vector2d(u, v)) / kFocal, {}, kFocal});
    }
    standing.add(frame);
    if (t < end_us / 4) continue;
    ++asked;
    stands += standing.stands(t, std::nullopt) ? 1 : 0;
  }
  return stands / static_cast<double>(asked);
}

}  // namespace

TEST_CASE("a parked car stands, whatever the pixel noise and however few the tracks") {
  for (const double noise : {0.0, 0.1, 0.83, 2.0, 5.0})
    for (const int tracks : {12, 30, 200}) {
      INFO("noise " << noise << " px, " << tracks << " tracks");
      CHECK(share_standing({tracks, noise}, 1) > 0.98);
    }
}

TEST_CASE("a car that creeps does not stand, whatever the pixel noise") {
  for (const double noise : {0.0, 0.1, 0.83, 2.0})
    for (const int tracks : {12, 30, 200}) {
      // In half a second twice the allowed pixel, or three times the noise of a displacement where that is more: a
      // dozen tracks cannot tell less.
      const double speed = 2.0 * std::max(2.0, 3.0 * std::sqrt(2.0) * noise);
      INFO("noise " << noise << " px, " << tracks << " tracks");
      CHECK(share_standing({tracks, noise, speed}, 2) < 0.02);
    }
}

TEST_CASE("constant motion is not taken for noise") {
  Standing standing{MsckfTrust{}};
  for (int64_t k = 1; k < 20; ++k) {
    SeenFrame frame;
    frame.t_us = k * kFramePeriodUs;
    for (int i = 0; i < 40; ++i)
      frame.points.push_back({i, Eigen::Vector2d(5.0 * static_cast<double>(k), i) / kFocal, {}, kFocal});
    standing.add(frame);
  }
  CHECK(standing.noise() < 1e-9);
  REQUIRE(standing.flow());
  CHECK(*standing.flow() > 20.0);
}
