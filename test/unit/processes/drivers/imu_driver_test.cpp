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
  CHECK(driver.state_reason(kStart).empty());
  CHECK(test::run_driver_over(driver, {reads[0], reads[1]}).sent.size() == 2);
  CHECK(driver.state_reason(kStart + 10'000).empty());
  CHECK(test::run_driver_over(driver, {reads.begin() + 2, reads.end()}).sent.size() == 8);
  CHECK(driver.state_reason(kStart + 1'000'000) == "the motion is beyond the IMU's range: 2 samples are clipped");
  CHECK(driver.state_reason(kStart + 4'000'000).empty());
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

TEST_CASE("the fixes and poses of the SBG go on over the wrap of their stamps too") {
  constexpr uint32_t kFirst = 4'294'000'000U;  // the counter of microseconds wraps in the fifth of ten epochs
  std::vector<RawRead> reads;
  for (uint32_t i = 0; i < 10; ++i) {
    Bytes bytes = test::sbg_gps_bytes(kFirst + 200'000U * i, 200 * i);
    test::append(bytes, test::sbg_solution_bytes(kFirst + 200'000U * i));
    reads.push_back({kStart + 200'000 * int64_t{i}, bytes});
  }
  ImuDriverConfig c = config();
  c.gnss_channel = "GNSS";
  c.solution_channel = "REFERENCE";
  ImuDriver driver(c);
  const test::CollectedSensors sent = test::run_driver_over(driver, reads);
  const auto fixes = sent.on<gnss_t>("GNSS");
  const auto poses = sent.on<pose_t>("REFERENCE");
  REQUIRE(fixes.size() == 10);
  REQUIRE(poses.size() == 10);
  for (std::size_t i = 1; i < 10; ++i) {
    CHECK(fixes[i].utime - fixes[i - 1].utime == Approx(200'000).margin(200));
    CHECK(poses[i].utime - poses[i - 1].utime == Approx(200'000).margin(200));
  }
}

/// Everything that the driver can read, in turn, each log read when it was due.
std::vector<RawRead> mixed_reads(uint32_t epochs) {
  std::vector<RawRead> reads;
  const auto add = [&](uint32_t t_us, const Bytes& bytes) { reads.push_back({kStart + int64_t{t_us}, bytes}); };
  for (uint32_t t = 0; t < 200'000 * epochs; t += 200'000) {
    for (uint32_t k = 0; k < 3; ++k) add(t + 5000 * k, test::sbg_imu_bytes(1'000'000 + t + 5000 * k));
    add(t + 20'000, test::sbg_gps_bytes(1'020'000 + t, t / 1000));
    add(t + 25'000, test::sbg_solution_bytes(1'025'000 + t));
  }
  return reads;
}

ImuDriverConfig all_channels() {
  ImuDriverConfig c = config();
  c.gnss_channel = "GNSS";
  c.solution_channel = "REFERENCE";
  return c;
}

TEST_CASE("SBG: however the stream is cut, the messages are the same") {
  const std::vector<RawRead> reads = mixed_reads(2);
  ImuDriver whole(all_channels());
  const auto expected = test::run_driver_over(whole, reads).sent;
  REQUIRE(expected.size() == 10);  // 6 samples, 2 fixes, 2 poses
  for (std::size_t i = 0; i < reads.size(); ++i) {
    for (std::size_t cut = 0; cut <= reads[i].bytes.size(); ++cut) {
      std::vector<RawRead> pieces = reads;
      const auto at = reads[i].bytes.begin() + static_cast<std::ptrdiff_t>(cut);
      pieces[i].bytes.assign(reads[i].bytes.begin(), at);
      pieces.insert(pieces.begin() + static_cast<std::ptrdiff_t>(i) + 1, {reads[i].utime, {at, reads[i].bytes.end()}});
      ImuDriver driver(all_channels());
      REQUIRE(test::run_driver_over(driver, pieces).sent == expected);
    }
  }
}

TEST_CASE("SBG: each byte that is wrong costs one frame, and a wrong checksum is counted") {
  const std::vector<RawRead> reads = mixed_reads(1);
  const auto sbg_row = [](const ImuDriver& driver) {
    for (const StreamCounters& row : driver.counters())
      if (row.name == "sbgECom") return row;
    return StreamCounters{};
  };
  ImuDriver whole(all_channels());
  static_cast<void>(test::run_driver_over(whole, reads));
  REQUIRE(sbg_row(whole).received == 8);
  int64_t wrong_checksums = 0, bytes = 0;
  for (std::size_t i = 0; i < reads.size(); ++i) {
    for (std::size_t at = 0; at < reads[i].bytes.size(); ++at) {
      std::vector<RawRead> damaged = reads;
      damaged[i].bytes[at] ^= 0x40U;
      damaged.push_back({kStart + 300'000, Bytes(5000, 0)});  // longer than any frame: nobody waits for an end any more
      ImuDriver driver(all_channels());
      static_cast<void>(test::run_driver_over(driver, damaged));
      REQUIRE(sbg_row(driver).received == 7);
      wrong_checksums += sbg_row(driver).bad_checksum;
      ++bytes;
    }
  }
  CHECK(wrong_checksums > bytes / 2);  // the others hit a frame's head or its end
}

}  // namespace
}  // namespace roadfix
