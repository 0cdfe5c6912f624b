// Are the covariances what the errors are? 50 simulated drives; NEES at one late epoch per drive, NIS per source. And
// eighty at the end of a minute of tunnel, where wheels and the no-sideslip constraint are all there is.
#include <catch2/catch.hpp>

#include "filter_run.h"
#include "geometry/so3.h"
#include "statistics/consistency.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

constexpr int kDrives = 50;
constexpr double kDuration = 107.0;  // s
constexpr double kEpoch = 105.0;     // s

struct Outcome {
  ConsistencyAccumulator position, attitude, velocity, gnss_nis;
  int scored = 0, inside = 0;  // components within three sigma
};

ScenarioConfig drive_config(double noise_factor) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = kDuration;
  s.imu.gyro_noise_radps_per_rthz *= noise_factor;
  s.imu.accel_noise_mps2_per_rthz *= noise_factor;
  s.gnss.sigma_horizontal_m *= noise_factor;
  s.gnss.sigma_up_m *= noise_factor;
  s.gnss.sigma_velocity_mps *= noise_factor;
  s.gnss.claimed_sigma_factor /= noise_factor;
  return s;
}

Outcome drive_all(double noise_factor, const std::function<void(NavigationConfig&)>& change) {
  const ScenarioConfig truth = drive_config(noise_factor);
  Outcome out;
  for (int seed = 1; seed <= kDrives; ++seed) {
    const SimulatedDrive drive = simulate(truth, static_cast<uint64_t>(seed));
    NavigationConfig config = filter_config(drive_config(1.0));
    change(config);
    Navigation filter(config);
    bool done = false;
    const int64_t start = drive.imu.front().t_us;
    run(filter, Samples(drive), [&](Navigation& f, int64_t now) {
      for (const AidingRecord& r : f.records())
        if (seconds_between(start, now) > 40.0 && r.source == AidingSource::kGnssPosition && r.dof == 3)
          out.gnss_nis.add(r.nis, r.dof);
      f.clear_records();
      if (done || seconds_between(start, now) < kEpoch) return;
      done = true;
      const Odometry o = f.output().imu;
      if (o.validity == Validity::kInvalid) return;
      const Eigen::Matrix<double, 9, 1> e = error_of(f, o, drive);
      const auto add = [&](ConsistencyAccumulator& to, const Eigen::Vector3d& error, const Eigen::Matrix3d& cov) {
        to.add(error.dot(cov.inverse() * error), 3);
        for (int i = 0; i < 3; ++i) out.inside += error(i) * error(i) <= 9.0 * cov(i, i);
        out.scored += 3;
      };
      add(out.position, e.head<3>(), o.cov_pose.topLeftCorner<3, 3>());
      add(out.attitude, e.segment<3>(3), o.cov_pose.bottomRightCorner<3, 3>());
      add(out.velocity, e.tail<3>(), o.cov_velocity);
    });
  }
  return out;
}

double all(const Outcome& o) { return (o.position.ratio() + o.attitude.ratio() + o.velocity.ratio()) / 3.0; }

void print(const char* name, const Outcome& o) {
  std::printf("%s: position %.3f attitude %.3f velocity %.3f (%d drives), NIS %.3f, within 3 sigma %.4f\n", name,
              o.position.ratio(), o.attitude.ratio(), o.velocity.ratio(), o.position.count(), o.gnss_nis.ratio(),
              static_cast<double>(o.inside) / o.scored);
}

}  // namespace

TEST_CASE("NEES and NIS of fifty drives are consistent") {
  const Outcome o = drive_all(1.0, [](NavigationConfig&) {});
  print("as configured", o);
  CHECK(o.position.count() >= kDrives - 1);
  CHECK(all(o) > 0.84);
  CHECK(all(o) < 1.18);
  CHECK(o.gnss_nis.ratio() > 0.84);
  CHECK(o.gnss_nis.ratio() < 1.18);
  CHECK(o.inside >= 0.99 * o.scored);
}

TEST_CASE("NEES is consistent without the non-holonomic constraint across as well") {
  const Outcome o = drive_all(1.0, [](NavigationConfig& c) { c.aiding.lateral_interval = 99.0; });
  print("without the constraint", o);
  CHECK(all(o) > 0.84);
  CHECK(all(o) < 1.18);
}

TEST_CASE("noise one and a half times as large stays within three sigma") {
  const Outcome o = drive_all(1.5, [](NavigationConfig&) {});
  print("noise x 1.5", o);
  CHECK(o.inside >= 0.99 * o.scored);
}

TEST_CASE("the consistency test sees a wrong lever arm") {
  const Outcome o = drive_all(1.0, [](NavigationConfig& c) {
    c.facts.p_imu_antenna.y() += 0.10;
    c.aiding.step_detection = false;  // it finds the antenna
  });
  print("lever arm 10 cm off", o);
  CHECK(all(o) > 1.18);
}

TEST_CASE("the consistency test sees a lever arm with its sign wrong") {
  const Outcome o = drive_all(1.0, [](NavigationConfig& c) {
    c.facts.p_imu_antenna.x() *= -1.0;
    c.aiding.step_detection = false;  // it finds the antenna
  });
  print("lever arm's x turned round", o);
  CHECK(all(o) > 1.18);
}

TEST_CASE("the consistency test sees too much process noise") {
  const Outcome o = drive_all(1.0, [](NavigationConfig& c) {
    c.facts.imu.gyro *= 4.0;
    c.facts.imu.accel *= 4.0;
  });
  print("process noise x 16", o);
  CHECK(all(o) < 0.84);
}
