// An imu that sits off the rear axle, askew: wheels and the constraint tell the axle's motion.
#include <catch2/catch.hpp>
#include <cstdio>

#include "statistics/consistency.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr int kDrives = 4;
constexpr double kDuration = 50.0;            // s, with turns
constexpr double kAskew = 0.05;               // rad, standard deviation
const Eigen::Vector3d kPlace(1.2, 0.4, 1.2);  // m, of the imu in the vehicle

struct Outcome {
  ConsistencyAccumulator velocity;
  double largest = 0.0;      ///< m/s
  double worst_place = 0.0;  ///< m, of the axle across
};

/// Twice a second. `change`: what the filter is told of the place and the mounting.
Outcome drive_all(const std::function<void(MsckfVehicle&)>& change) {
  Outcome out;
  test::VisualDriveConfig car = test::city_drive(kDuration);
  car.tracks.wanted = 60;
  car.scenario.imu.position_m = kPlace;
  car.scenario.imu.mounting_std_rad.setConstant(kAskew);
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    const test::VisualDrive drive = test::make_drive(car, seed);
    MsckfConfig config = test::filter_config(car);
    test::tell_place(drive.drive, config.vehicle);
    const double across = config.vehicle.p_imu_axle.y();
    change(config.vehicle);
    Msckf filter(config);
    int64_t next = drive.drive.imu.front().t_us;
    test::run(filter, drive, true, [&](const Msckf& f) {
      const Odometry o = f.output().odometry;
      if (o.t_us < next || o.validity == Validity::kInvalid) return;
      next = o.t_us + 500'000;
      const Eigen::Vector3d e = test::error_of(o, drive).tail<3>();
      out.velocity.add(e.dot(o.cov_velocity.inverse() * e), 3);
      out.largest = std::max(out.largest, e.norm());
    });
    REQUIRE(filter.state() != nullptr);
    out.worst_place = std::max(out.worst_place, std::abs(filter.state()->camera.p_imu_axle.y() - across));
  }
  std::printf("an imu off the axle: velocity %.2f, largest error %.2f m/s, axle across %.2f m off\n",
              out.velocity.ratio(), out.largest, out.worst_place);
  return out;
}

}  // namespace

TEST_CASE("an imu off the rear axle is told where it is, or learns it") {
  const Outcome told = drive_all([](MsckfVehicle& v) { v.p_imu_axle_std.setConstant(0.05); });
  const Outcome unknown = drive_all([](MsckfVehicle& v) {
    v.p_imu_axle.setZero();
    v.p_imu_axle_std << 1.0, 0.5, 0.5;
    v.mounting.setZero();
    v.mounting_std = kAskew;
  });
  // The sibling: called beside the axle, as wheels had it.
  const Outcome beside = drive_all([](MsckfVehicle& v) { v.p_imu_axle.setZero(); });
  for (const Outcome& o : {told, unknown}) {
    CHECK(o.velocity.ratio() < 1.5);
    CHECK(o.velocity.ratio() > 0.5);
    CHECK(o.worst_place < 0.1);
  }
  CHECK(beside.velocity.ratio() > 3.0);
  CHECK(beside.largest > 1.5 * told.largest);
}

TEST_CASE("a mounting that is told wrong and called exact is seen") {
  const Outcome wrong = drive_all([](MsckfVehicle& v) {
    v.p_imu_axle_std.setConstant(0.05);
    v.mounting.setZero();
    v.mounting_std = 1e-4;
  });
  CHECK(wrong.velocity.ratio() > 1.4);
}
