// Restarts at a pose that is given: the filter goes on from there, knows how well the pose was known, and counts.
#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr double kAsked_s = 14.0, kAge_s = 0.5, kEnd_s = 20.0;
constexpr double kPlaceStd = 0.1, kYawStd = 0.01, kTiltStd = 0.003;
/// Where the drive is said to be: somewhere else.
const SE3 kElsewhere{exp_q({0.0, 0.0, 0.7}), {400.0, -150.0, 8.0}};

test::VisualDriveConfig car() {
  test::VisualDriveConfig c = test::city_drive(kEnd_s);
  c.tracks.wanted = 80;
  return c;
}

const test::VisualDrive& drive() {
  static const test::VisualDrive kDrive = test::make_drive(car(), 8);
  return kDrive;
}

MsckfRestart true_restart(int64_t t_us) {
  const Odometry truth = drive().drive.truth_at(t_us);
  MsckfRestart r{t_us, kElsewhere * truth.T_frame_vehicle, truth.velocity, {}};
  r.cov_pose.setZero();
  r.cov_pose.diagonal() << kPlaceStd * kPlaceStd, kPlaceStd * kPlaceStd, kPlaceStd * kPlaceStd, kTiltStd * kTiltStd,
      kTiltStd * kTiltStd, kYawStd * kYawStd;
  return r;
}

/// Every sample; half a second after its time the restart that `make` gives for that time.
struct Driven {
  MsckfOutput before, at, end;
  bool taken = false;
  double not_running_s = 0.0;  ///< after the restart
  Vector6d error;              ///< at the end, against the drive elsewhere
};

Driven drive_and_restart(Msckf& filter, const test::VisualDrive& d, const std::function<MsckfRestart(int64_t)>& make) {
  Driven out;
  const int64_t start = d.drive.imu.front().t_us;
  const auto asked_us = start + static_cast<int64_t>(1e6 * kAsked_s);
  bool asked = false;
  test::run(filter, d, false, [&](const Msckf& f) {
    out.end = f.output();
    const int64_t now_us = out.end.odometry.t_us;
    if (asked && out.end.phase != MsckfPhase::kRunning) out.not_running_s += 0.01;
    if (asked || now_us < asked_us + static_cast<int64_t>(1e6 * kAge_s)) return;
    asked = true;
    out.before = out.end;
    out.taken = filter.restart(make(asked_us));
    out.at = f.output();
  });
  const Odometry truth = d.drive.truth_at(out.end.odometry.t_us);
  out.error = local(out.end.odometry.T_frame_vehicle, kElsewhere * truth.T_frame_vehicle);
  return out;
}

/// Root of the normalised square over six.
double share_of_sigma(const Driven& d) {
  return std::sqrt(d.error.dot(d.end.odometry.cov_pose.inverse() * d.error) / 6.0);
}

uint64_t digest_of(const Msckf& filter) {
  Digest digest;
  filter.digest(digest);
  return digest.value();
}

}  // namespace

TEST_CASE("a restart takes place, heading and covariance given, and goes on without a break") {
  Msckf filter(test::filter_config(car()));
  const Driven d = drive_and_restart(filter, drive(), true_restart);
  REQUIRE(d.taken);
  CHECK(d.before.reset_counter == 0);
  CHECK(d.at.reset_counter == 1);
  CHECK(d.end.reset_counter == 1);
  CHECK(d.not_running_s == 0.0);
  CHECK(d.end.odometry.validity == Validity::kValid);
  CHECK(d.error.head<3>().norm() < 4.0);  // 1.7 m claimed, 1.9 m rms over seeds
  CHECK(d.error.tail<3>().norm() < 0.02);
  CHECK(share_of_sigma(d) < 2.0);
  // What the pose given was not worth stays: vision and imu see neither place nor heading.
  CHECK(d.end.odometry.cov_pose(0, 0) > kPlaceStd * kPlaceStd);
  CHECK(d.end.odometry.cov_pose(5, 5) > 0.9 * kYawStd * kYawStd);
  const SE3 &from = d.before.odometry.T_frame_vehicle, &to = d.at.odometry.T_frame_vehicle;
  CHECK((from.p + d.at.reset_delta.p - to.p).norm() < 1e-9);
  CHECK((from.q * d.at.reset_delta.q).angularDistance(to.q) < 1e-9);
  CHECK(d.at.reset_delta.p.norm() > 100.0);
}

TEST_CASE("the test of restarts sees a speed and a heading that are wrong") {
  const auto too_fast = [](int64_t t_us) {
    MsckfRestart r = true_restart(t_us);
    r.velocity.x() += 12.0;
    return r;
  };
  const auto turned = [](int64_t t_us) {
    MsckfRestart r = true_restart(t_us);
    r.T_local_vehicle.q = r.T_local_vehicle.q * exp_q({0.0, 0.0, 0.15});
    return r;
  };
  for (const auto& make :
       {std::function<MsckfRestart(int64_t)>(too_fast), std::function<MsckfRestart(int64_t)>(turned)}) {
    Msckf filter(test::filter_config(car()));
    CHECK(share_of_sigma(drive_and_restart(filter, drive(), make)) > 3.0);
  }
}

TEST_CASE("a restart while samples are missing begins behind the gap, with a doubt as large") {
  test::VisualDrive gap = drive();
  const int64_t start = gap.drive.imu.front().t_us;
  std::erase_if(gap.drive.imu, [&](const ImuSample& s) {
    const double t = seconds_between(start, s.t_us);
    return t > kAsked_s - 0.4 && t < kAsked_s + 0.3;
  });
  Msckf filter(test::filter_config(car()));
  const Driven d = drive_and_restart(filter, gap, true_restart);
  REQUIRE(d.taken);
  CHECK(d.before.phase == MsckfPhase::kLost);
  CHECK(d.end.reset_counter == d.before.reset_counter + 1);
  CHECK(d.not_running_s == 0.0);
  CHECK(share_of_sigma(d) < 2.0);
  CHECK(d.end.odometry.cov_pose(5, 5) > 2.0 * kYawStd * kYawStd);
}

TEST_CASE("a restart that says nothing usable changes nothing") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::function<void(MsckfRestart&)>> spoilt = {
      [&](MsckfRestart& r) { r.T_local_vehicle.p.x() = nan; },
      [&](MsckfRestart& r) { r.velocity.y() = nan; },
      [&](MsckfRestart& r) { r.cov_pose(2, 2) = nan; },
      [&](MsckfRestart& r) { r.cov_pose(2, 2) = -1.0; },
      [&](MsckfRestart& r) { r.T_local_vehicle.q.coeffs().setZero(); },
      [&](MsckfRestart& r) { r.t_us += 60'000'000; }};
  for (const auto& spoil : spoilt) {
    Msckf filter(test::filter_config(car()));
    CHECK_FALSE(filter.restart(true_restart(drive().drive.imu.front().t_us)));  // nothing has come yet
    uint64_t before = 0;
    int count = 0;
    test::run(filter, drive(), false, [&](const Msckf& f) {
      if (++count != 300) return;
      before = digest_of(f);
      MsckfRestart r = true_restart(f.output().odometry.t_us - 500'000);
      spoil(r);
      CHECK_FALSE(filter.restart(r));
      CHECK(digest_of(f) == before);
      CHECK(f.output().reset_counter == 0);
    });
  }
}
