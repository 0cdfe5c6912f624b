#include <catch2/catch.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>

#include "drivers/imu_driver/handler.h"
#include "support/driver_run.h"
#include "support/sbg_logs.h"

namespace roadfix {
namespace {

using test::Bytes;
using test::RawRead;

constexpr int64_t kStart = 1'700'000'000'000'000;

ImuDriverConfig config() {
  ImuDriverConfig c;
  c.device.device = "pty:";
  return c;
}

TEST_CASE("IMU_SHORT comes out in x forward, y left, z up, and its stamps go on over the wrap") {
  std::vector<RawRead> reads;
  const uint32_t first = 4'294'000'000U;  // the counter wraps after a second
  for (uint32_t i = 0; i < 1000; ++i)
    reads.push_back({kStart + 5000 * i + (i * 7919U) % 3000U, test::sbg_imu_bytes(first + 5000U * i)});
  ImuDriver driver(config());
  const auto samples = test::run_driver_over(driver, reads).on<imu_t>("IMU");
  REQUIRE(samples.size() > 990);  // the first ones may be stamped late
  for (std::size_t i = 100; i < samples.size(); ++i) {
    REQUIRE(std::abs(samples[i].utime - samples[i - 1].utime - 5000) < 200);  // reading jitters by 3 ms
  }
  const imu_t& m = samples.back();
  CHECK(m.accel_mps2[0] == 1.0);
  CHECK(m.accel_mps2[1] == -2.0);
  CHECK(m.accel_mps2[2] == 10.0);
  CHECK(m.gyro_radps[0] == Approx(0.1));
  CHECK(m.gyro_radps[1] == Approx(-0.2));
  CHECK(m.gyro_radps[2] == Approx(0.3));
}

TEST_CASE("a sensor that fails its own test is refused and counted") {
  ImuDriver driver(config());
  CHECK(test::run_driver_over(driver,
                              {{kStart, test::sbg_imu_bytes(1000, 0x03FE)}, {kStart + 5000, test::sbg_imu_bytes(6000)}})
            .sent.size() == 1);
  CHECK(driver.counters().back().refused == 1);
}

TEST_CASE("motion beyond the sensor's range is used, and told for three seconds") {
  ImuDriver driver(config());
  std::vector<RawRead> reads;
  for (uint32_t i = 0; i < 10; ++i) {
    const auto status = static_cast<uint16_t>(i == 4 ? 0x02FF : i == 6 ? 0x01FF : 0x03FF);  // accelerometer, gyroscope
    reads.push_back({kStart + 5000 * i, test::sbg_imu_bytes(5000U * i, status)});
  }
  CHECK(driver.trouble(kStart).empty());
  CHECK(test::run_driver_over(driver, {reads[0], reads[1]}).sent.size() == 2);
  CHECK(driver.trouble(kStart + 10'000).empty());
  CHECK(test::run_driver_over(driver, {reads.begin() + 2, reads.end()}).sent.size() == 8);
  CHECK(driver.trouble(kStart + 1'000'000) == "the motion is beyond the IMU's range: 2 samples are clipped");
  CHECK(driver.trouble(kStart + 4'000'000).empty());
}

TEST_CASE("GPS1_POS, GPS1_VEL and GPS1_HDT of one moment make one fix") {
  std::vector<RawRead> reads;
  for (uint32_t i = 0; i < 10; ++i) {
    const Bytes bytes = test::sbg_gps_bytes(1'000'000 + 200'000 * i, 200 * i);
    reads.push_back({kStart + 200'000 * int64_t{i}, bytes});
  }
  ImuDriverConfig c = config();
  c.gnss_channel = "GNSS";
  c.baseline_heading_deg = 90.0;
  ImuDriver driver(c);
  const auto fixes = test::run_driver_over(driver, reads).on<gnss_t>("GNSS");
  REQUIRE(fixes.size() == 10);
  const gnss_t& m = fixes[5];
  CHECK(m.fix_type == gnss_t::FIX_RTK_FLOAT);
  CHECK(m.height_kind == gnss_t::HEIGHT_ELLIPSOID);
  CHECK(m.height_m == Approx(167.5));
  CHECK(m.lon_deg == Approx(179.999));
  CHECK(m.cov_enu_m2[0][0] == Approx(0.25));    // east 0.5 m
  CHECK(m.cov_enu_m2[1][1] == Approx(0.0625));  // north 0.25 m
  REQUIRE(m.has_velocity);
  CHECK(m.velocity_enu_mps[0] == Approx(2.0));
  CHECK(m.velocity_enu_mps[1] == Approx(1.0));
  CHECK(m.velocity_enu_mps[2] == Approx(-3.0));
  CHECK(m.cov_velocity_enu_m2ps2[0][0] == Approx(0.04));
  REQUIRE(m.has_heading);
  CHECK(m.heading_deg == Approx(300.0));
  CHECK_FALSE(m.has_correction_age);
  ImuDriver silent(config());
  CHECK(test::run_driver_over(silent, reads).sent.empty());
}

TEST_CASE("EKF_QUAT with EKF_NAV is a pose in east, north, up of the vehicle's axes") {
  // Heading east, level: body x (forward) is east, y (right) is south. Driving north-east at 1, 2 m/s.
  const Bytes bytes = test::sbg_solution_bytes(5000);
  ImuDriverConfig c = config();
  c.solution_channel = "REFERENCE";
  ImuDriver driver(c);
  const auto poses = test::run_driver_over(driver, {{kStart, bytes}}).on<pose_t>("REFERENCE");
  REQUIRE(poses.size() == 1);
  const pose_t& m = poses[0];
  CHECK(m.anchor_lat_deg == Approx(48.0));
  CHECK(m.anchor_height_m == Approx(144.0));
  CHECK(m.validity == pose_t::VALIDITY_VALID);
  CHECK(m.q_wxyz[0] == Approx(1.0).margin(1e-6));  // facing east is no turn in east, north, up
  CHECK(m.velocity_mps[0] == Approx(2.0).margin(1e-6));
  CHECK(m.velocity_mps[1] == Approx(1.0).margin(1e-6));  // north is to the left
  CHECK(m.cov_pose_m2_rad2[0][0] == Approx(0.04));
  CHECK(m.cov_pose_m2_rad2[1][1] == Approx(0.01));
}

}  // namespace
}  // namespace roadfix
