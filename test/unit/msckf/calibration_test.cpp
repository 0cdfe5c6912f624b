// What is estimated on the way: the camera's time, rotation and place, each with an honest sigma, and nothing where the
// calibration claims to know.
#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr double kSigmas = 4.0;

struct Found {
  bool running = false;
  int resets = 0;
  double offset = 0.0, offset_std = 0.0;
  Eigen::Vector3d turn, turn_std, place, place_std;  ///< errors that are left, and their sigmas
};

test::VisualDriveConfig city(double time_offset) {
  test::VisualDriveConfig car = test::city_drive(45.0);
  car.tracks.wanted = 80;
  car.time_offset = time_offset;
  return car;
}

Found drive(const test::VisualDriveConfig& car, const std::function<void(MsckfVehicle&)>& change) {
  const test::VisualDrive d = test::make_drive(car, 14);
  MsckfConfig config = test::filter_config(car);
  change(config.vehicle);
  Msckf filter(config);
  test::run(filter, d, false, [](const Msckf&) {});
  Found r;
  r.resets = filter.output().reset_counter;
  const msckf::State* s = filter.state();
  r.running = s != nullptr;
  if (s == nullptr) return r;
  const SE3 truth = test::T_vehicle_camera();
  const Eigen::VectorXd std = s->P().diagonal().head(msckf::kBaseSize).cwiseSqrt();
  r.offset = s->camera.time_offset;
  r.offset_std = std(msckf::kTimeOffset);
  r.turn = log_q(s->camera.T_imu_camera.q.conjugate() * truth.q);
  r.turn_std = std.segment<3>(msckf::kCameraTurn);
  r.place = truth.p - s->camera.T_imu_camera.p;
  r.place_std = std.segment<3>(msckf::kCameraPlace);
  return r;
}

}  // namespace

TEST_CASE("a camera's time offset is found on the way, up to 0.3 s") {
  const double offset = GENERATE(0.05, 0.3, -0.3);
  const Found f = drive(city(offset), [](MsckfVehicle& v) { v.time_offset_std = 0.1; });
  INFO("offset " << offset << " found " << f.offset << " sigma " << f.offset_std << " resets " << f.resets);
  std::printf("time offset %.2f s: found %.4f, sigma %.4f, %d resets\n", offset, f.offset, f.offset_std, f.resets);
  REQUIRE(f.running);
  CHECK(f.resets == 0);
  CHECK(std::abs(f.offset - offset) < kSigmas * f.offset_std);
  CHECK(std::abs(f.offset - offset) < 0.005);
}

TEST_CASE("without the search for it 0.3 s are not found") {
  const Found f = drive(city(0.3), [](MsckfVehicle& v) { v.time_offset_std = 0.025; });
  CHECK((!f.running || f.resets > 0 || std::abs(f.offset - 0.3) > 0.02));
}

TEST_CASE("a time offset that the calibration claims to know is not looked for, and what it costs shows") {
  const Found f = drive(city(0.1), [](MsckfVehicle& v) { v.time_offset_std = 0.0; });
  CHECK((!f.running || f.resets > 0 || f.offset == 0.0));
  CHECK((!f.running || std::abs(f.offset - 0.1) > 0.09));
}

TEST_CASE("the camera's rotation and place are found on the way") {
  const Eigen::Vector3d turned(0.03, -0.02, 0.025), moved(0.15, -0.1, 0.1);
  const auto wrong = [&](MsckfVehicle& v) {
    v.T_imu_camera.q = v.T_imu_camera.q * exp_q(turned);
    v.T_imu_camera.p += moved;
  };
  const Found f = drive(city(0.0), [&](MsckfVehicle& v) {
    wrong(v);
    v.camera_turn_std = 0.03;
    v.camera_std = 0.15;
  });
  REQUIRE(f.running);
  CHECK(f.resets == 0);
  CHECK(f.turn.norm() < 0.2 * turned.norm());
  CHECK((f.turn.array().abs() < kSigmas * f.turn_std.array()).all());
  CHECK((f.place.array().abs() < kSigmas * f.place_std.array()).all());
  CHECK(f.place_std.minCoeff() < 0.12);  // something was learnt of it
  // Where the calibration claims to know, nothing moves.
  const Found claimed = drive(city(0.0), wrong);
  CHECK((!claimed.running || claimed.turn.norm() > 0.9 * turned.norm()));
}
