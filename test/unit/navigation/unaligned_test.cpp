// Beside a receiver that tells no heading yet: a camera holds a local frame meanwhile.
#include <catch2/catch.hpp>
#include <cstdio>
#include <optional>

#include "local_run.h"
#include "navigation/navigation.h"

using namespace roadfix;
using namespace roadfix::navigation;
using namespace roadfix::test;

namespace {

struct Aligned {
  double first_s = -1.0, enu_s = -1.0;      ///< after the first sample: any valid pose, the first in enu
  int invalid_between = 0;                  ///< poses
  int resets = 0;                           ///< counted from the first valid pose to the first in enu
  double missed_m = 0.0, missed_rad = 0.0;  ///< by which the reset says otherwise than the poses beside it
  double local_m = 0.0, local_way_m = 0.0;  ///< of the way in the local frame: what its length misses, and the true one
  int compared = 0;                         ///< poses, with one that goes on from a snapshot
  bool same_bits = true;                    ///< of those
};

/// City drive, of which all before from_s is missing, beside a receiver that knows where it is by 10 m once a second and no
/// velocity, from fixes_s on; `receiver`: the calibration has it. A snapshot is taken `snapshot_s` after the first valid pose.
Aligned aligned(double from_s, double fixes_s, int eyes, double snapshot_s = -1.0, bool receiver = true) {
  const TrackDrive& d = city();
  NavigationConfig c = config_of(d, {.eyes = eyes, .wheels = false});
  c.sources.gnss_position = c.sources.gnss_velocity = c.sources.gnss_heading = true;
  c.facts.has_receiver = receiver;
  c.facts.p_imu_antenna = d.drive.config.gnss.lever_arm_m - d.drive.config.imu.position_m;
  Navigation filter(c);
  std::optional<Navigation> resumed;
  const int64_t start = d.drive.imu.front().t_us + std::llround(1e6 * from_s);
  int64_t fix_us = 0;
  Aligned out;
  NavigationOutput before;
  std::optional<SE3> first, first_true;
  for (const DriveEvent& e : d.events) {
    const int64_t t_us = stamp_of(e);
    const double t = seconds_between(start, t_us);
    if (t < 0.0) continue;
    const auto each = [&](const auto& use) {
      use(filter);
      if (resumed) use(*resumed);
    };
    if (const auto* given = std::get_if<GnssFix>(&e);
        given != nullptr && t >= fixes_s && seconds_between(fix_us, t_us) > 0.95) {
      GnssFix fix = *given;
      fix.velocity.reset();
      fix.cov_enu = 100.0 * Eigen::Matrix3d::Identity();
      fix_us = t_us;
      each([&](Navigation& f) { f.add(fix); });
    }
    if (const auto* frame = std::get_if<TrackFrame>(&e); frame != nullptr && eyes > 0)
      each([&](Navigation& f) { f.add(picture_of(*frame, eyes == 2)); });
    const auto* imu = std::get_if<ImuSample>(&e);
    if (imu == nullptr) continue;
    each([&](Navigation& f) {
      (void)f.advance(*imu);
      f.clear_records();
    });
    const NavigationOutput o = filter.output();
    if (resumed) {
      const NavigationOutput again = resumed->output();
      ++out.compared;
      out.same_bits = out.same_bits && again.odometry.T_frame_vehicle.p == o.odometry.T_frame_vehicle.p &&
                      again.local == o.local && again.reset_counter == o.reset_counter;
    }
    const bool valid = o.odometry.validity != Validity::kInvalid;
    out.invalid_between += first && !valid ? 1 : 0;
    if (!valid) continue;
    const SE3 T = o.imu.T_frame_vehicle, truth = d.drive.truth_at(t_us).T_frame_vehicle;
    if (!first) {
      first = T;
      first_true = truth;
      out.first_s = t;
      out.resets = -o.reset_counter;
    }
    if (snapshot_s >= 0.0 && !resumed && t > out.first_s + snapshot_s) resumed.emplace(c).load(filter.save());
    if (o.local) {
      out.local_way_m = (truth.p - first_true->p).norm();
      out.local_m = std::abs((T.p - first->p).norm() - out.local_way_m);
      before = o;
      continue;
    }
    out.enu_s = t;
    out.resets += o.reset_counter;
    if (before.local) {
      out.missed_m = (T.p - before.imu.T_frame_vehicle.p - o.reset_delta.p).norm();
      const Eigen::Quaterniond turned = before.odometry.T_frame_vehicle.q * o.reset_delta.q;
      out.missed_rad = turned.angularDistance(o.odometry.T_frame_vehicle.q);
    }
    break;
  }
  return out;
}

}  // namespace

TEST_CASE("until fixes have told the heading a camera holds a local frame, and one reset leads out of it") {
  for (const double from_s : {0.0, 20.0}) {
    for (const int eyes : {0, 1, 2}) {
      const Aligned a = aligned(from_s, 0.0, eyes);
      std::printf("from %.0f s, eyes %d: first %.2f s, enu %.2f s, %.2f of %.0f m, reset off by %.3f m %.4f rad\n",
                  from_s, eyes, a.first_s, a.enu_s, a.local_m, a.local_way_m, a.missed_m, a.missed_rad);
      REQUIRE(a.enu_s > 5.0);
      if (eyes == 0) {
        CHECK(a.first_s == a.enu_s);
        continue;
      }
      CHECK(a.first_s < 3.5);
      CHECK(a.invalid_between == 0);
      CHECK(a.resets == 1);
      CHECK(a.local_m < 0.1 * a.local_way_m + 0.1);
      CHECK(a.missed_m < 0.3);
      CHECK(a.missed_rad < 0.02);
    }
  }
}

TEST_CASE(
    "fixes that come to a resting car's local frame leave it without a pose for no longer than a new start takes") {
  const Aligned a = aligned(0.0, 0.7, 1, -1.0, false);
  std::printf("first %.2f s, enu %.2f s, %d without a pose\n", a.first_s, a.enu_s, a.invalid_between);
  CHECK(a.first_s < 0.7);
  CHECK(a.enu_s > 5.0);
  CHECK(a.invalid_between < 200);
}

TEST_CASE("while it seeks its heading it goes on from a snapshot to the same bits") {
  const Aligned a = aligned(20.0, 0.0, 1, 1.0);
  CHECK(a.compared > 500);
  CHECK(a.same_bits);
}
