// Without GNSS, whatever goes wrong with the pictures is coasting on the imu, and no valid pose where that does not know the
// speed any more; the filter begins again then.
#include <catch2/catch.hpp>

#include "simulation/random.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr double kBegin_s = 8.0, kEnd_s = 23.0, kDrive_s = 45.0;

struct Driven {
  double outside = 0.0;  ///< largest error of a valid velocity over its sigma, any axis
  bool coasted = false;  ///< coasting after a valid pose
  bool lost = false;     ///< invalid after one
  navigation::NavigationOutput end;
};

/// A city drive with `spoil` done to the pictures from kBegin_s to kEnd_s, and an accelerometer said to be that noisy.
Driven drive(const std::function<void(TrackPicture&)>& spoil, std::optional<double> accel_noise = {}) {
  test::VisualDriveConfig car = test::city_drive(kDrive_s);
  car.tracks.wanted = 60;
  test::VisualDrive d = test::make_drive(car, 12);
  const int64_t start = d.drive.imu.front().t_us;
  for (TrackPicture& p : d.frames) {
    const double t = seconds_between(start, p.t_us);
    if (t > kBegin_s && t < kEnd_s) spoil(p);
  }
  navigation::NavigationConfig config = test::filter_config(car);
  if (accel_noise) config.facts.imu.accel = *accel_noise;
  navigation::Navigation filter(config);
  Driven r;
  bool begun = false;
  int count = 0;
  test::run(filter, d, false, [&](navigation::Navigation& f) {
    if (++count % 10 != 0) return;
    r.end = f.output();
    const Odometry& o = r.end.odometry;
    r.lost = r.lost || (begun && o.validity == Validity::kInvalid);
    r.coasted = r.coasted || (begun && o.validity == Validity::kCoasting);
    if (o.validity == Validity::kInvalid) return;
    begun = true;
    const Eigen::Vector3d e = d.drive.truth_at(o.t_us).velocity - o.velocity;
    r.outside = std::max(r.outside, e.cwiseQuotient(o.cov_velocity.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff());
  });
  return r;
}

}  // namespace

TEST_CASE("a drive without faults is never lost") {
  const Driven d = drive([](TrackPicture&) {});
  CHECK_FALSE(d.lost);
  CHECK_FALSE(d.coasted);
  CHECK(d.end.reset_counter == 0);
  CHECK(d.outside < 5.0);
}

namespace {

void scatter(TrackPicture& p) {
  RandomStream random(static_cast<uint64_t>(p.t_us), 0xD1F);
  for (TrackSighting& s : p.tracks) s.left += Eigen::Vector2d(22.0 * random.normal(), 22.0 * random.normal());
}

}  // namespace

TEST_CASE("tracks that do not fit are coasting, and no velocity is wrong by more than it says") {
  const Driven d = drive(scatter);
  CHECK(d.coasted);
  CHECK(d.outside < 5.0);
  CHECK(d.end.reset_counter == 0);
  CHECK(d.end.odometry.validity == Validity::kValid);
}

TEST_CASE("tracks that do not fit end in lost where the imu does not carry the speed, and the filter comes back") {
  const Driven d = drive(scatter, 1.0);
  CHECK(d.lost);
  CHECK(d.end.reset_counter > 0);
  CHECK(d.end.odometry.validity == Validity::kValid);
}

TEST_CASE("darkness is coasting, then lost, and no valid velocity is wrong by more than it says") {
  const Driven d = drive([](TrackPicture& p) { p.tracks.clear(); });
  CHECK(d.outside < 5.0);
  CHECK(d.end.odometry.validity != Validity::kInvalid);
}
