// Starts in motion: what the covariance says of the speed and of the levelling must be what they are, at the start and
// a second later.
#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr uint64_t kDrives = 6;
constexpr double kLaterUs = 1e6;

/// Squared errors over their variances, per component, at the first running picture and a second later.
struct Started {
  double velocity = 0.0, levelling = 0.0, later = 0.0;
  double widest = 0.0;  ///< m/s, largest sigma of a forward speed at the start
  int starts = 0;
};

double square(const Eigen::Vector3d& e, const Eigen::Matrix3d& P) { return e.dot(P.inverse() * e) / 3.0; }

/// The city's drives with the pictures before their first turn taken away: no wheels, no INS.
Started start_in_turns(double sigma_share) {
  Started sum;
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    const test::VisualDriveConfig car = test::city_drive(40.0);
    test::VisualDrive drive = test::make_drive(car, seed);
    const auto turning = [&](const msckf::SeenFrame& f) {
      const Odometry truth = drive.drive.truth_at(f.t_us);
      return truth.velocity.x() > 3.0 && std::abs(truth.angular_rate.z()) > 0.12;
    };
    const auto first = std::find_if(drive.frames.begin(), drive.frames.end(), turning);
    if (first == drive.frames.end()) continue;
    drive.frames.erase(drive.frames.begin(), first);
    Msckf filter(test::filter_config(car));
    std::optional<int64_t> begun_us;
    bool later = false;
    test::run(filter, drive, false, [&](const Msckf& f) {
      if (later) return;
      const MsckfOutput o = f.output();
      if (o.phase != MsckfPhase::kRunning || o.reset_counter != 0) return;
      const Odometry truth = drive.drive.truth_at(o.odometry.t_us);
      const Eigen::Vector3d e = o.odometry.velocity - truth.velocity;
      const Eigen::Matrix3d P = sigma_share * sigma_share * o.odometry.cov_velocity;
      if (!begun_us) {
        begun_us = o.odometry.t_us;
        ++sum.starts;
        sum.velocity += square(e, P);
        sum.widest = std::max(sum.widest, std::sqrt(P(0, 0)));
        const Eigen::Vector3d up = o.odometry.T_frame_vehicle.q.conjugate() * Eigen::Vector3d::UnitZ();
        const Eigen::Vector3d true_up = truth.T_frame_vehicle.q.conjugate() * Eigen::Vector3d::UnitZ();
        const Eigen::Vector2d tilt = up.cross(true_up).head<2>();
        const Eigen::Matrix2d T = sigma_share * sigma_share * o.odometry.cov_pose.block<2, 2>(3, 3);
        sum.levelling += tilt.dot(T.inverse() * tilt) / 2.0;
      } else if (static_cast<double>(o.odometry.t_us - *begun_us) > kLaterUs) {
        sum.later += square(e, P);
        later = true;
      }
    });
  }
  std::printf(
      "starts in turns, sigma x %.2f: velocity %.3f levelling %.3f, a second later %.3f (%d starts, to %.2f m/s)\n",
      sigma_share, sum.velocity / sum.starts, sum.levelling / sum.starts, sum.later / sum.starts, sum.starts,
      sum.widest);
  return sum;
}

}  // namespace

TEST_CASE("a start in a turn knows how little it knows") {
  const Started s = start_in_turns(1.0);
  REQUIRE(s.starts >= 4);
  CHECK(s.velocity / s.starts < 2.0);
  CHECK(s.levelling / s.starts < 2.0);
  CHECK(s.later / s.starts < 2.0);
  CHECK(s.widest < 5.0);  // not by knowing nothing
}

TEST_CASE("the test of starts in turns sees sigmas that are too small") {
  const Started s = start_in_turns(0.2);
  CHECK(s.levelling / s.starts > 2.0);
  CHECK(s.velocity / s.starts > 2.0);
  CHECK(s.later / s.starts > 2.0);
}

TEST_CASE("a start in motion says whose speed it took") {
  test::VisualDriveConfig car = test::highway_drive(8.0);
  car.scenario.motion.route = RouteKind::kColdStartMoving;
  const test::VisualDrive drive = test::make_drive(car, 3);
  for (const bool wheels : {false, true}) {
    Msckf filter(test::filter_config(car));
    std::optional<MsckfScale> first;
    test::run(filter, drive, wheels, [&](const Msckf& f) {
      const int64_t now = f.output().odometry.t_us;
      if (!wheels && !first) filter.add_speed(now, drive.drive.truth_at(now).velocity.x(), 0.2);
      if (!first && f.state() != nullptr) first = f.output().scale;
    });
    REQUIRE(first);
    CHECK(*first == (wheels ? MsckfScale::kWheels : MsckfScale::kIns));
  }
}
