/// What other sensors and the last motion say about the next one.
#include "slam/motion_prior.h"

#include <catch2/catch.hpp>

#include "geometry/so3.h"

namespace roadfix {
namespace {

const SE3 kVehicleCamera{Eigen::Quaterniond::Identity(), {1.5, 0.0, 1.2}};

/// Ten seconds of both sources, with the given sigmas of one sample.
DistancePrior with_speeds(ScaleChoice choice, double wheels_sigma, double ins_sigma) {
  DistancePrior prior(choice, kVehicleCamera);
  for (int i = 0; i <= 100; ++i) {
    prior.add({100'000 * i, SpeedSource::kWheels, 10.0, wheels_sigma, 0.01});
    prior.add({100'000 * i, SpeedSource::kIns, 11.0, ins_sigma, 0.0});
  }
  prior.begin_frame();
  return prior;
}

TEST_CASE("a distance comes from the source with the smaller sigma, of those that are chosen") {
  const auto distance = [](ScaleChoice choice, double wheels_sigma, double ins_sigma) {
    return with_speeds(choice, wheels_sigma, ins_sigma).of_vehicle(2'000'000, 3'000'000);
  };
  CHECK(distance(ScaleChoice::kWheels, 0.1, 0.01)->travelled.distance == Approx(10.0));
  CHECK(distance(ScaleChoice::kIns, 0.1, 2.0)->travelled.distance == Approx(11.0));
  CHECK(distance(ScaleChoice::kAuto, 0.1, 0.01)->source == SpeedSource::kIns);
  CHECK(distance(ScaleChoice::kAuto, 0.1, 5.0)->source == SpeedSource::kWheels);
  CHECK_FALSE(distance(ScaleChoice::kNone, 0.1, 0.1));
}

TEST_CASE("speeds are used from the next frame on") {
  DistancePrior prior(ScaleChoice::kAuto, kVehicleCamera);
  prior.add({0, SpeedSource::kWheels, 5.0, 0.1, 0.01});
  prior.add({1'000'000, SpeedSource::kWheels, 5.0, 0.1, 0.01});
  CHECK_FALSE(prior.of_vehicle(0, 1'000'000));
  prior.begin_frame();
  CHECK(prior.of_vehicle(0, 1'000'000)->travelled.distance == Approx(5.0));
}

TEST_CASE("in a turn the camera goes farther than the axle that the speed is of") {
  const DistancePrior prior = with_speeds(ScaleChoice::kWheels, 0.1, 0.1);
  constexpr double kRadius = 12.0, kTurn = 10.0 / kRadius;
  const SE3 T_begin_vehicle{exp_q({0.0, 0.0, kTurn}),
                            {kRadius * std::sin(kTurn), kRadius * (1.0 - std::cos(kTurn)), 0.0}};
  const SE3 T_begin_end = kVehicleCamera.inverse() * T_begin_vehicle * kVehicleCamera;
  SE3 direction = T_begin_end;  // of unknown length, as an essential matrix gives it
  direction.p.normalize();
  const auto distance = prior.of_camera(2'000'000, SE3{}, 3'000'000, direction);
  CHECK(distance->travelled.distance == Approx(T_begin_end.p.norm()).epsilon(1e-9));
  CHECK(distance->travelled.distance > T_begin_vehicle.p.norm() + 0.01);  // teeth
}

TEST_CASE("the last motion continues, in proportion to the time") {
  VelocityPrior prior;
  const SE3 T{exp_q({0.1, 0.2, 0.3}), {1.0, 2.0, 3.0}};
  CHECK(prior.predict(T, 0.1).p == T.p);
  CHECK(prior.velocity_sigma(0.0) > 10.0);
  prior.set(FrameMotion{{exp_q({0.0, 0.04, 0.0}), {0.0, 0.0, 2.0}}, 0.2});
  CHECK(prior.speed() == Approx(10.0));
  const SE3 moved = T.inverse() * prior.predict(T, 0.1);
  CHECK((moved.p - Eigen::Vector3d(0.0, 0.0, 1.0)).norm() < 1e-12);
  CHECK((log_q(moved.q) - Eigen::Vector3d(0.0, 0.02, 0.0)).norm() < 1e-12);
  CHECK(prior.velocity_sigma(0.3) > prior.velocity_sigma(0.1));
  CHECK(prior.since_loss(2.0).distance > 20.0);
  prior.rescale(2.0);
  CHECK(prior.speed() == Approx(20.0));
}

TEST_CASE("gravity levels the map once, from the first sufficient attitude at a frame") {
  GravityPrior prior(0.005);
  const Eigen::Quaterniond q_map_vehicle = exp_q({0.02, -0.01, 0.4}), q_level_vehicle = exp_q({0.0, 0.03, 2.0});
  const Eigen::Vector3d pivot(1.0, 2.0, 3.0);
  prior.record(1'000'000, q_map_vehicle);
  prior.add({1'010'000, q_level_vehicle, 0.02});   // not sufficient
  prior.add({1'200'000, q_level_vehicle, 0.001});  // no frame at its time
  CHECK_FALSE(prior.take_levelling(pivot));
  prior.add({1'010'000, q_level_vehicle, 0.001});
  const auto levelling = prior.take_levelling(pivot);
  REQUIRE(levelling);
  CHECK(levelling->q.angularDistance(levelling_rotation(q_map_vehicle, q_level_vehicle)) < 1e-12);
  CHECK(levelling->pivot == pivot);
  CHECK(levelling->sigma == 0.001);
  prior.record(2'000'000, q_map_vehicle);
  prior.add({2'000'000, q_level_vehicle, 0.001});
  CHECK_FALSE(prior.take_levelling(pivot));
}

TEST_CASE("the axes of a given pose are not levelled") {
  GravityPrior prior(0.005);
  prior.record(1'000'000, Eigen::Quaterniond::Identity());
  prior.add({1'000'000, exp_q({0.0, 0.03, 0.0}), 0.001});
  prior.set_known();
  CHECK_FALSE(prior.take_levelling(Eigen::Vector3d::Zero()));
}

}  // namespace
}  // namespace roadfix
