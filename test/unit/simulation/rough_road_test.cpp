#include "simulation/rough_road.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>

#include "simulation/scenarios.h"
#include "simulation/simulate.h"

namespace roadfix {
namespace {

constexpr double kClassB = 64e-6;  // m3
constexpr double kWheelbase = 2.7;
constexpr double kTrack = 1.55;

RoughRoad road(double roughness, std::uint64_t seed) { return {roughness, kWheelbase, kTrack, RandomStream(seed, 1)}; }

/// Means over many roads of the squares of the steps of a standing car's height over a distance.
double structure_function(double roughness, double distance_m, double track) {
  double sum = 0.0;
  constexpr int kRoads = 400, kPlaces = 20;
  for (int seed = 0; seed < kRoads; ++seed) {
    const RoughRoad r(roughness, kWheelbase, track, RandomStream(static_cast<std::uint64_t>(seed), 1));
    for (int i = 0; i < kPlaces; ++i) {
      const Eigen::Vector2d a(37.0 * i, 11.0 * i);
      const Eigen::Vector2d b = a + distance_m * Eigen::Vector2d(std::cos(i), std::sin(i));
      const double step = r.at(b, 0.0, {0.0, 0.0}).heave - r.at(a, 0.0, {0.0, 0.0}).heave;
      sum += step * step;
    }
  }
  return sum / (kRoads * kPlaces);
}

TEST_CASE("the road's profile along any line has the spectrum of its class") {
  // A spectrum of G n0^2 / n^2 has steps of the square 2 pi^2 G n0^2 d over a distance d; waves longer than 90 m, which
  // it lacks, are a hundredth of that a metre.
  for (const double d : {1.0, 2.0, 4.0}) {
    CAPTURE(d);
    const double expected = 2.0 * kPi * kPi * kClassB * 0.01 * d;
    const double measured = structure_function(kClassB, d, 1e-3);
    CHECK(measured == Approx(expected).epsilon(0.1));
    CHECK_FALSE(measured == Approx(2.0 * expected).epsilon(0.1));
    CHECK_FALSE(structure_function(1.5 * kClassB, d, 1e-3) == Approx(expected).epsilon(0.1));
  }
}

TEST_CASE("pitch and roll of a standing car are those of the plane below its wheels") {
  // A car turned by 90 degrees whose axle lies where the first one's left wheels are, and one that is as long as the
  // first is wide, see the same four points.
  const RoughRoad r(kClassB, 2.0, 2.0, RandomStream(4, 1));
  const BodyDisplacement a = r.at({5.0, 7.0}, 0.3, {0.0, 0.0});
  const Eigen::Vector2d forward(std::cos(0.3), std::sin(0.3));
  const Eigen::Vector2d left(-forward.y(), forward.x());
  const BodyDisplacement b = r.at(Eigen::Vector2d(5.0, 7.0) + forward - left, 0.3 + kPi / 2.0, {0.0, 0.0});
  CHECK(std::abs(a.pitch) > 1e-4);
  CHECK(std::abs(a.roll) > 1e-4);
  CHECK(b.pitch == Approx(-a.roll));  // its nose points to the first one's left
  CHECK(b.roll == Approx(a.pitch));
  const BodyDisplacement far = r.at(Eigen::Vector2d(5.0, 7.0) + 2.0 * forward, 0.3, {0.0, 0.0});
  CHECK(far.heave == Approx(a.heave - 2.0 * a.pitch));  // its rear axle is where the first one's front axle is
}

TEST_CASE("the body follows slow waves, swings with those at its own frequency and stays above fast ones") {
  const double bounce = 2.0 * kPi * 1.3;
  CHECK(body_response(0.0) == std::complex<double>(1.0, 0.0));
  CHECK(std::abs(body_response(0.05 * bounce)) == Approx(1.0).margin(0.01));
  CHECK(std::abs(body_response(bounce)) == Approx(std::hypot(1.0, 0.6) / 0.6).epsilon(1e-3));
  CHECK(std::abs(body_response(10.0 * bounce)) < 1e-3);
  CHECK(body_response(-bounce) == std::conj(body_response(bounce)));
  CHECK(body_response(bounce).imag() < 0.0);  // it lags
}

struct Spread {
  double heave_m = 0.0, up_mps = 0.0, pitch_radps = 0.0;
};

/// Root mean squares at a constant speed over 40 roads.
Spread spread(double roughness, double speed) {
  constexpr double kStep_s = 1e-3;
  constexpr int kRoads = 40, kTimes = 50;
  Spread sum;
  for (int seed = 0; seed < kRoads; ++seed) {
    const RoughRoad r = road(roughness, static_cast<std::uint64_t>(seed));
    for (int i = 0; i < kTimes; ++i) {
      const Eigen::Vector2d p(speed * 3.7 * i, 0.0);
      const BodyDisplacement now = r.at(p, 0.0, {speed, 0.0});
      const BodyDisplacement next = r.at(p + Eigen::Vector2d(speed * kStep_s, 0.0), 0.0, {speed, 0.0});
      sum.heave_m += now.heave * now.heave;
      sum.up_mps += std::pow((next.heave - now.heave) / kStep_s, 2);
      sum.pitch_radps += std::pow((next.pitch - now.pitch) / kStep_s, 2);
    }
  }
  const double n = kRoads * kTimes;
  return {std::sqrt(sum.heave_m / n), std::sqrt(sum.up_mps / n), std::sqrt(sum.pitch_radps / n)};
}

TEST_CASE("the body heaves by about a centimetre and a few centimetres per second") {
  const Spread town = spread(kClassB, 13.9);
  // White vertical velocity of the road, (2 pi n0)^2 G v per Hz, through a bandwidth of w (1 + 4 z^2) / (8 z) = 4.6 Hz
  // that the cut at 4 Hz and the width of the track make smaller.
  const double up = 2.0 * kPi * 0.1 * std::sqrt(kClassB * 13.9 * 4.6);
  CHECK(town.up_mps < up);
  CHECK(town.up_mps > 0.8 * up);
  CHECK_FALSE(spread(0.5 * kClassB, 13.9).up_mps > 0.8 * up);
  CHECK_FALSE(spread(1.8 * kClassB, 13.9).up_mps < up);
  CHECK(town.heave_m > 0.005);
  CHECK(town.heave_m < 0.02);
  CHECK(town.pitch_radps > 0.005);
  CHECK(town.pitch_radps < 0.03);
  CHECK(spread(kClassB, 1.4).up_mps < 0.5 * town.up_mps);
}

TEST_CASE("an even road leaves the body alone") {
  const BodyDisplacement ride = road(0.0, 1).at({3.0, 4.0}, 0.2, {10.0, 0.0});
  CHECK(ride.heave == 0.0);
  CHECK(ride.pitch == 0.0);
  CHECK(ride.roll == 0.0);
}

TEST_CASE("a simulated car heaves while it drives, and not at all where it stops") {
  const SimulatedDrive drive = simulate(scenario("city_loop"), 1);
  double square = 0.0;
  int stands = 0;
  for (std::size_t i = 5; i + 5 < drive.truth.size(); ++i) {
    const Odometry& o = drive.truth[i];
    square += o.velocity.z() * o.velocity.z();
    const auto place = [&](std::size_t k) { return drive.truth[k].T_frame_vehicle.p.head<2>(); };
    if (place(i - 5) != place(i) || place(i + 5) != place(i)) continue;
    ++stands;
    CHECK(o.velocity.norm() == 0.0);
    CHECK(o.angular_rate.norm() == 0.0);
    CHECK(o.T_frame_vehicle.p.z() == drive.truth[i - 5].T_frame_vehicle.p.z());
  }
  const double up = std::sqrt(square / static_cast<double>(drive.truth.size()));
  CHECK(up > 0.015);
  CHECK(up < 0.06);
  CHECK(stands > 100);
}

TEST_CASE("the same place passed at the same speed has the same bump, another seed has others") {
  const RoughRoad r = road(kClassB, 3);
  const BodyDisplacement a = r.at({100.0, 20.0}, 0.1, {12.0, 1.2});
  const BodyDisplacement b = r.at({100.0, 20.0}, 0.1, {12.0, 1.2});
  CHECK(a.heave == b.heave);
  CHECK(a.heave != road(kClassB, 4).at({100.0, 20.0}, 0.1, {12.0, 1.2}).heave);
}

TEST_CASE("the road's roughness changes no sensor's errors") {
  ScenarioConfig config = scenario("city_loop");
  const SimulatedDrive rough = simulate(config, 7);
  config.motion.road_roughness_m3 = 0.0;
  const SimulatedDrive even = simulate(config, 7);
  CHECK(rough.errors.wheel_scale == even.errors.wheel_scale);
  CHECK(rough.errors.hard_iron == even.errors.hard_iron);
  REQUIRE(rough.gnss.size() == even.gnss.size());
  for (std::size_t i = 0; i < rough.gnss.size(); ++i) {
    REQUIRE((rough.errors.gnss[i].position - even.errors.gnss[i].position).norm() < 1e-6);
    REQUIRE(rough.errors.imu_bias[i].gyro == even.errors.imu_bias[i].gyro);
  }
  CHECK(rough.imu[2000].accel != even.imu[2000].accel);
}

}  // namespace
}  // namespace roadfix
