// Whatever goes wrong ends in `lost` with its cause, no valid pose is given out meanwhile, and the filter starts again.
#include <catch2/catch.hpp>

#include "simulation/random.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr double kBegin_s = 8.0, kEnd_s = 18.0;

test::VisualDriveConfig car() {
  test::VisualDriveConfig c = test::city_drive(26.0);
  c.tracks.wanted = 60;
  return c;
}

struct Driven {
  std::vector<std::string> reasons;  ///< of being lost, in order, each once
  bool valid_while_lost = false;
  MsckfOutput end;
};

Driven drive(const std::function<void(MsckfConfig&)>& change, const std::function<void(test::VisualDrive&)>& spoil) {
  static const test::VisualDrive kDrive = test::make_drive(car(), 12);
  test::VisualDrive d = kDrive;
  spoil(d);
  MsckfConfig config = test::filter_config(car());
  change(config);
  Msckf filter(config);
  Driven r;
  test::run(filter, d, true, [&](const Msckf& f) {
    r.end = f.output();
    if (r.end.phase != MsckfPhase::kLost) return;
    r.valid_while_lost = r.valid_while_lost || r.end.odometry.validity != Validity::kInvalid;
    const bool start = r.end.reason.find("moving") != std::string::npos;  // on its way back
    if (!start && (r.reasons.empty() || r.reasons.back() != r.end.reason)) r.reasons.push_back(r.end.reason);
  });
  return r;
}

void none(MsckfConfig&) {}

/// While it lasts, with the seconds since it began.
void spoil_imu(test::VisualDrive& d, const std::function<void(ImuSample&, double)>& spoil) {
  const int64_t start = d.drive.imu.front().t_us;
  for (ImuSample& s : d.drive.imu) {
    const double t = seconds_between(start, s.t_us);
    if (t > kBegin_s && t < kEnd_s) spoil(s, t - kBegin_s);
  }
}

void require_lost_by(const Driven& d, const std::string& cause) {
  REQUIRE_FALSE(d.reasons.empty());
  CHECK_THAT(d.reasons.front(), Catch::Contains(cause));
  CHECK_FALSE(d.valid_while_lost);
  CHECK(d.end.reset_counter > 0);
}

}  // namespace

TEST_CASE("a drive without faults is never lost") {
  const Driven d = drive(none, [](test::VisualDrive&) {});
  CHECK(d.reasons.empty());
  CHECK(d.end.reset_counter == 0);
}

TEST_CASE("an impossible speed ends in lost") {
  require_lost_by(drive([](MsckfConfig& c) { c.trust.max_speed = 5.0; }, [](test::VisualDrive&) {}), "speed");
}

TEST_CASE("points that do not fit end in lost, and the filter comes back") {
  const Driven d = drive(none, [](test::VisualDrive& spoilt) {
    const int64_t start = spoilt.drive.imu.front().t_us;
    RandomStream random(3, 0xD1F);
    for (msckf::SeenFrame& f : spoilt.frames) {
      const double t = seconds_between(start, f.t_us);
      if (t < kBegin_s || t > kEnd_s) continue;
      for (msckf::SeenPoint& p : f.points) {
        const double u = random.normal(), v = random.normal();
        p.left += 0.05 * Eigen::Vector2d(u, v);
      }
    }
  });
  require_lost_by(d, "points do not fit");
  CHECK(d.end.phase == MsckfPhase::kRunning);
  CHECK(d.end.odometry.validity == Validity::kValid);
}

TEST_CASE("an accelerometer bias out of range ends in lost, and the filter comes back") {
  const Driven d = drive(
      [](MsckfConfig& c) { c.vehicle.correlation_s = 1.0; },
      [](test::VisualDrive& spoilt) { spoil_imu(spoilt, [](ImuSample& s, double t) { s.accel.z() += 0.3 * t; }); });
  require_lost_by(d, "accelerometer bias");
  CHECK(d.end.phase == MsckfPhase::kRunning);
}

TEST_CASE("a gyro bias out of range ends in lost, and the filter comes back") {
  const Driven d = drive(
      [](MsckfConfig& c) { c.vehicle.correlation_s = 1.0; },
      [](test::VisualDrive& spoilt) { spoil_imu(spoilt, [](ImuSample& s, double t) { s.gyro.y() += 3e-3 * t; }); });
  require_lost_by(d, "gyro bias");
  CHECK(d.end.phase == MsckfPhase::kRunning);
}
