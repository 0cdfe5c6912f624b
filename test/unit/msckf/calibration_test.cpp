// What is estimated on the way: the camera's time, rotation and place, each with an honest sigma, and nothing where the
// calibration claims to know.
#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "simulation/random.h"
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

/// Means over starts in a turn of squared errors over their variances, at the end of the drive. The camera's clock,
/// turn and place are hardly known; `told`: of the sigmas by which they are off.
struct Honesty {
  double speed = 0.0, turn = 0.0, place = 0.0;
  int running = 0;
};

constexpr uint64_t kStarts = 6;
constexpr double kOff_s = 0.13, kOffStd_s = 0.3, kTurnStd = 0.15, kPlaceStd = 0.5;

Honesty start_in_turns(double told) {
  Honesty sum;
  for (uint64_t seed = 1; seed <= kStarts; ++seed) {
    test::VisualDriveConfig car = city(kOff_s);
    test::VisualDrive d = test::make_drive(car, seed);
    const auto turning = [&](const msckf::SeenFrame& f) {
      const Odometry truth = d.drive.truth_at(f.t_us);
      return truth.velocity.x() > 3.0 && std::abs(truth.angular_rate.z()) > 0.12;
    };
    d.frames.erase(d.frames.begin(), std::find_if(d.frames.begin(), d.frames.end(), turning));
    MsckfConfig config = test::filter_config(car);
    MsckfVehicle& v = config.vehicle;
    v.time_offset_std = kOffStd_s;
    v.camera_turn_std = told * kTurnStd;
    v.camera_std = told * kPlaceStd;
    RandomStream random(seed, 0xCA3E);
    Eigen::Vector3d turned = Eigen::Vector3d::Zero(), moved = Eigen::Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {
      turned(i) = kTurnStd * random.normal();
      moved(i) = kPlaceStd * random.normal();
    }
    v.T_imu_camera.q = v.T_imu_camera.q * exp_q(turned);
    v.T_imu_camera.p += moved;
    Msckf filter(config);
    test::run(filter, d, false, [](const Msckf&) {});
    const msckf::State* s = filter.state();
    if (s == nullptr) continue;
    ++sum.running;
    const Odometry o = filter.output().odometry;
    const double e = o.velocity.x() - d.drive.truth_at(o.t_us).velocity.x();
    sum.speed += e * e / o.cov_velocity(0, 0);
    const SE3 truth = test::T_vehicle_camera();
    const auto square = [&](const Eigen::Vector3d& error, int at) {
      return error.dot(s->P().block<3, 3>(at, at).inverse() * error) / 3.0;
    };
    sum.turn += square(log_q(s->camera.T_imu_camera.q.conjugate() * truth.q), msckf::kCameraTurn);
    sum.place += square(truth.p - s->camera.T_imu_camera.p, msckf::kCameraPlace);
  }
  for (double* mean : {&sum.speed, &sum.turn, &sum.place}) *mean /= sum.running;
  std::printf("cameras hardly known, told %.2f of it: speed %.2f turn %.2f place %.2f (%d starts)\n", told, sum.speed,
              sum.turn, sum.place, sum.running);
  return sum;
}

}  // namespace

TEST_CASE("a camera whose clock, turn and place are hardly known teaches no more than it can") {
  const Honesty h = start_in_turns(1.0);
  CHECK(h.running == kStarts);
  CHECK(h.speed < 3.0);
  CHECK(h.turn < 2.5);
  CHECK(h.place < 2.5);
}

TEST_CASE("the test of hardly known cameras sees doubts that are too small") {
  const Honesty h = start_in_turns(0.2);  // 0.3 of it is soon mended by a rough road: it tells where the camera sits
  CHECK(h.place > 2.5);
}

TEST_CASE("there is no pose until the camera's clock is known, and a snapshot from then goes on with the same bits") {
  const test::VisualDriveConfig car = city(kOff_s);
  const test::VisualDrive d = test::make_drive(car, 14);
  MsckfConfig config = test::filter_config(car);
  config.vehicle.time_offset_std = kOffStd_s;
  Msckf filter(config), other(config);
  std::vector<uint8_t> saved;
  size_t frame = 0;
  bool begun = false;
  for (const ImuSample& imu : d.drive.imu) {
    for (; frame < d.frames.size() && d.frames[frame].t_us <= imu.t_us; ++frame) {
      filter.add(d.frames[frame]);
      if (!saved.empty()) other.add(d.frames[frame]);
    }
    (void)filter.advance(imu);
    if (!saved.empty()) (void)other.advance(imu);
    if (!begun && filter.state() != nullptr) {
      begun = true;
      CHECK(std::abs(filter.state()->camera.time_offset - kOff_s) < 0.01);
    }
    if (saved.empty() && seconds_between(d.drive.imu.front().t_us, imu.t_us) > 10.0) {
      CHECK(filter.output().reason == "the camera's clock is not yet known");
      saved = filter.save();
      other.load(saved);
    }
  }
  REQUIRE(begun);
  CHECK(filter.save() == other.save());
}

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

// A rough road's pitching tells the clock even so.
TEST_CASE("without the search for it 0.3 s are not found on an even road") {
  test::VisualDriveConfig even = city(0.3);
  even.scenario.motion.road_roughness_m3 = 0.0;
  const Found f = drive(even, [](MsckfVehicle& v) { v.time_offset_std = 0.025; });
  CHECK((!f.running || f.resets > 0 || std::abs(f.offset - 0.3) > 0.02));
}

TEST_CASE("a time offset that the calibration claims to know is not looked for, and what it costs shows") {
  const Found f = drive(city(0.1), [](MsckfVehicle& v) { v.time_offset_std = 0.0; });
  CHECK((!f.running || f.resets > 0 || f.offset == 0.0));
  CHECK((!f.running || std::abs(f.offset - 0.1) > 0.09));
}

/// Position, attitude and velocity at the end of four drives whose pictures are stamped `late` s too early: mean of
/// squared errors over their variances, and the largest error of the position.
struct Driven {
  double nees = 0.0, farthest = 0.0;  ///< 1, m
  int resets = 0;
};

Driven with_clock(double late, double time_offset_std) {
  constexpr uint64_t kDrives = 4;
  Driven r;
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    const test::VisualDriveConfig car = city(late);
    const test::VisualDrive d = test::make_drive(car, seed);
    MsckfConfig config = test::filter_config(car);
    config.vehicle.time_offset_std = time_offset_std;
    Msckf filter(config);
    test::run(filter, d, false, [](const Msckf&) {});
    const MsckfOutput o = filter.output();
    const Eigen::Matrix<double, 9, 1> e = test::error_of(o.odometry, d);
    r.nees += e.head<6>().dot(o.odometry.cov_pose.inverse() * e.head<6>()) / (9.0 * kDrives);
    r.nees += e.tail<3>().dot(o.odometry.cov_velocity.inverse() * e.tail<3>()) / (9.0 * kDrives);
    r.farthest = std::max(r.farthest, e.head<3>().norm());
    r.resets += o.reset_counter;
  }
  std::printf("clock %.0f ms off, sigma %.0f ms: NEES %.2f, at most %.2f m off, %d resets\n", 1e3 * late,
              1e3 * time_offset_std, r.nees, r.farthest, r.resets);
  return r;
}

TEST_CASE("the doubt of a clock that nothing is told of bears 30 ms, costs nothing of an exact one, none does not") {
  const Driven late = with_clock(0.03, kSilentClockStd), exact = with_clock(0.0, kSilentClockStd);
  const Driven sure = with_clock(0.0, 0.0), wrong = with_clock(0.03, 0.0);
  CHECK(late.nees < 1.7);
  CHECK(exact.nees < 1.7);
  CHECK(late.resets + exact.resets == 0);
  CHECK(late.farthest < 1.2 * sure.farthest);
  CHECK(exact.farthest < 1.2 * sure.farthest);
  CHECK(wrong.nees > 20.0);
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
