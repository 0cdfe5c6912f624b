// What is no car: a rig that is carried in every direction and turned about every axis, its imu on its side, and a
// calibration that does not know which way is ahead (EuRoC's recordings).
#include <catch2/catch.hpp>

#include "geometry/euler.h"
#include "navigation/navigation.h"
#include "support/flight.h"

using namespace roadfix;

namespace {

constexpr uint64_t kFlights = 6;

struct Flown {
  double nees = 0.0;       ///< of place, attitude and velocity at the end, mean over the flights
  double worst_pct = 0.0;  ///< of the way, error of the place at the end
  double fastest = 0.0;    ///< m/s, largest error of the velocity
  double latest_s = 0.0;   ///< first valid pose
  int resets = 0;
};

/// The filter's errors, tied by yaw and place at its first valid pose.
Flown fly() {
  Flown sum;
  for (uint64_t seed = 1; seed <= kFlights; ++seed) {
    const test::FlightConfig config;
    const test::Flight flight = test::make_flight(config, seed);
    navigation::Navigation filter(test::filter_config(config));
    std::optional<SE3> T_frame_room;
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    double way = 0.0;
    size_t frame = 0;
    for (size_t i = 0; i < flight.imu.size(); ++i) {
      const int64_t t_us = flight.imu[i].t_us;
      while (frame < flight.frames.size() && flight.frames[frame].t_us <= t_us) filter.add(flight.frames[frame++]);
      (void)filter.advance(flight.imu[i]);
      const Odometry& truth = flight.truth[i];
      way += (truth.T_frame_vehicle.p - last).norm();
      last = truth.T_frame_vehicle.p;
      if (i % 20 != 0) continue;
      const Odometry o = filter.output().odometry;
      if (o.validity == Validity::kInvalid) continue;
      if (!T_frame_room) {
        const Eigen::Quaterniond q(
            Eigen::AngleAxisd(yaw_between(truth.T_frame_vehicle.q, o.T_frame_vehicle.q), Eigen::Vector3d::UnitZ()));
        T_frame_room = SE3{q, o.T_frame_vehicle.p - q * truth.T_frame_vehicle.p};
        sum.latest_s = std::max(sum.latest_s, seconds_between(flight.imu.front().t_us, t_us));
      }
      sum.fastest = std::max(sum.fastest, (o.velocity - truth.velocity).norm());
    }
    const navigation::NavigationOutput end = filter.output();
    REQUIRE(T_frame_room);
    const Odometry& o = end.odometry;
    const Vector6d e = local(o.T_frame_vehicle, *T_frame_room * flight.truth.back().T_frame_vehicle);
    const Eigen::Vector3d e_velocity = flight.truth.back().velocity - o.velocity;
    const auto square = [](const Eigen::Vector3d& x, const Eigen::Matrix3d& P) { return x.dot(P.inverse() * x) / 3.0; };
    sum.nees += (square(e.head<3>(), o.cov_pose.topLeftCorner<3, 3>()) +
                 square(e.tail<3>(), o.cov_pose.bottomRightCorner<3, 3>()) + square(e_velocity, o.cov_velocity)) /
                (3.0 * kFlights);
    sum.worst_pct = std::max(sum.worst_pct, 100.0 * e.head<3>().norm() / way);
    sum.resets += end.reset_counter;
  }
  std::printf("flights: NEES %.3f, worst %.3f %% of the way, %.3f m/s, from %.2f s, %d resets\n", sum.nees,
              sum.worst_pct, sum.fastest, sum.latest_s, sum.resets);
  return sum;
}

}  // namespace

TEST_CASE("a rig that flies through a room is followed, though the constraint of cars is on") {
  const Flown flown = fly();
  CHECK(flown.nees < 1.3);
  CHECK(flown.worst_pct < 0.2);
  CHECK(flown.fastest < 0.2);
  CHECK(flown.latest_s < 1.0);
  CHECK(flown.resets == 0);
  constexpr double kThird = 0.33;
  CHECK(flown.nees / (kThird * kThird) > 1.3);  // sigmas of a third would be found out
}
