// Numbers that no device can mean, in frames whose checksums are right, as the promises of test/fuzz have them.
#include <catch2/catch.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "config/config.h"
#include "drivers/gnss_driver/handler.h"
#include "drivers/imu_driver/handler.h"
#include "drivers/wheel_driver/handler.h"
#include "support/driver_run.h"
#include "support/receiver_bytes.h"
#include "support/sbg_logs.h"

namespace roadfix {
namespace {

using test::Bytes;

const int64_t kStart = *utc_us(2024, 5, 3, 12, 0, 0);

GnssDriverConfig gnss_config() {
  GnssDriverConfig c;
  c.device.device = "pty:";
  c.moving_base = true;
  return c;
}

/// A receiver's one epoch, alone: its fix, and how many of its parts were refused.
struct Alone {
  std::vector<gnss_t> fixes;
  int64_t refused = 0;
};

Alone gnss_alone(const Bytes& epoch) {
  GnssDriver driver(gnss_config());
  Alone result;
  result.fixes = test::run_driver_over(driver, {{kStart, epoch}, {kStart + 500'000, {}}}).on<gnss_t>("GNSS");
  result.refused = driver.counters()[0].refused;
  return result;
}

/// A NAV-PVT whose payload has `value` at `offset`.
template <class T>
Alone pvt_with(std::size_t offset, T value) {
  const Bytes frame = test::pvt_bytes(kStart, 1000, 48.0);
  Bytes payload(frame.begin() + 6, frame.end() - 2);
  std::memcpy(payload.data() + offset, &value, sizeof value);
  return gnss_alone(test::ubx_bytes(1, 7, payload));
}

TEST_CASE("UBX: a place that is none on Earth, or an error of zero, is refused and counted") {
  CHECK(pvt_with<int32_t>(28, 899'999'999).fixes.size() == 1);  // teeth: just south of the pole
  const std::vector<Alone> refused = {pvt_with<int32_t>(28, 900'000'001), pvt_with<int32_t>(28, INT32_MIN),
                                      pvt_with<int32_t>(32, 20'000'001),  pvt_with<int32_t>(32, INT32_MIN),
                                      pvt_with<uint32_t>(40, 0),          pvt_with<uint32_t>(44, 0)};
  for (const Alone& alone : refused) {
    CHECK(alone.fixes.empty());
    CHECK(alone.refused == 1);
  }
}

TEST_CASE("UBX: an impossible speed goes, its position stays") {
  for (const Alone& alone :
       {pvt_with<int32_t>(48, 1'000'001), pvt_with<int32_t>(56, INT32_MIN), pvt_with<uint32_t>(68, 0)}) {
    REQUIRE(alone.fixes.size() == 1);
    CHECK_FALSE(alone.fixes[0].has_velocity);
    CHECK(alone.refused == 1);
  }
  CHECK(pvt_with<int32_t>(48, 999'000).fixes[0].has_velocity);
}

TEST_CASE("UBX: a receiver without a fix is heard of, whatever its place says, and claims nothing") {
  const Bytes frame = test::pvt_bytes(kStart, 1000, 48.0);
  Bytes payload(frame.begin() + 6, frame.end() - 2);
  payload[20] = payload[21] = 0;
  std::fill(payload.begin() + 24, payload.begin() + 48, uint8_t{0x7F});
  const Alone alone = gnss_alone(test::ubx_bytes(1, 7, payload));
  REQUIRE(alone.fixes.size() == 1);
  CHECK(alone.fixes[0].fix_type == gnss_t::FIX_NONE);
  CHECK(alone.fixes[0].lat_deg == 0.0);
  CHECK_FALSE(alone.fixes[0].has_velocity);
  CHECK(alone.refused == 0);
}

TEST_CASE("the date line has one longitude: 180 degrees are -180") {
  CHECK(pvt_with<int32_t>(24, 1'800'000'000).fixes[0].lon_deg == -180.0);
  CHECK(pvt_with<int32_t>(24, -1'800'000'000).fixes[0].lon_deg == -180.0);
  CHECK(pvt_with<int32_t>(24, 1'799'999'999).fixes[0].lon_deg > 179.0);
}

Alone nmea_alone(const std::string& hdop_and_heights, const std::string& speed = "10.0", const std::string& gst = "") {
  Bytes bytes = test::nmea_bytes("GNRMC,120000.00,A,4800.0,N,00315.0,W," + speed + ",270.0,030524,,,A");
  if (!gst.empty()) test::append(bytes, test::nmea_bytes("GNGST,120000.00,1,,,," + gst));
  test::append(bytes, test::nmea_bytes("GNGGA,120000.00,4800.0,N,00315.0,W,4,12," + hdop_and_heights + ",,"));
  return gnss_alone(bytes);
}

TEST_CASE("NMEA: numbers of a hundred digits, and zeros for errors") {
  const std::string huge = "1" + std::string(180, '0');
  const Alone good = nmea_alone("1.5,120.0,M,47.5,M");
  REQUIRE(good.fixes.size() == 1);
  CHECK(good.refused == 0);
  CHECK(nmea_alone(huge + ",120.0,M,47.5,M").fixes.empty());  // its square is infinite
  CHECK(nmea_alone("1.5," + huge + ",M,47.5,M").fixes.empty());
  CHECK(nmea_alone("1.5,120.0,M,47.5,M", "10.0", huge + ",0.4,0.9").fixes.empty());
  const Alone fast = nmea_alone("1.5,120.0,M,47.5,M", huge);
  REQUIRE(fast.fixes.size() == 1);
  CHECK_FALSE(fast.fixes[0].has_velocity);
  CHECK(fast.refused == 1);
  CHECK(nmea_alone("0,120.0,M,47.5,M").fixes.at(0).cov_enu_m2[0][0] == Approx(4e-4));  // HDOP not known: that of 1
  const Alone zero = nmea_alone("1.5,120.0,M,47.5,M", "10.0", "0.0,0.0,0.0");
  CHECK(zero.fixes.at(0).cov_enu_m2[0][0] == Approx(9e-4));  // GST without numbers: HDOP's
}

ImuDriverConfig imu_config() {
  ImuDriverConfig c;
  c.device.device = "pty:";
  c.gnss_channel = "GNSS";
  c.solution_channel = "REFERENCE";
  return c;
}

TEST_CASE("SBG: places and errors that cannot be") {
  const auto fixes = [](double lat_deg) {
    ImuDriver driver(imu_config());
    const Bytes bytes = test::sbg_gps_bytes(1000, 200, lat_deg);
    const auto found = test::run_driver_over(driver, {{kStart, bytes}, {kStart + 500'000, {}}}).on<gnss_t>("GNSS");
    CHECK(driver.counters().back().refused == (found.empty() ? 2 : 1));  // the first heading is not waited for
    return found.size();
  };
  CHECK(fixes(89.9) == 1);
  CHECK(fixes(90.1) == 0);
  CHECK(fixes(std::nan("")) == 0);
  const auto poses = [](float position_std_m) {
    ImuDriver driver(imu_config());
    const Bytes bytes = test::sbg_solution_bytes(1000, position_std_m);
    return test::run_driver_over(driver, {{kStart, bytes}}).on<pose_t>("REFERENCE").size();
  };
  CHECK(poses(0.1F) == 1);
  CHECK(poses(0.0F) == 0);
  CHECK(poses(3e38F) == 0);
  CHECK(poses(std::nanf("")) == 0);
}

TEST_CASE("wheels: magnitudes have no sign, and no car turns by a thousand radians in a second") {
  const auto wheels = [](const std::string& more, const std::string& data) {
    WheelDriver driver(
        parse_config<WheelDriverConfig>("{device: 'pty:', speeds: [{frame: '1', signed: true, length: 8}], "
                                        "yaw_rate: {frame: '1', start_bit: 8, length: 8, factor: 10}" +
                                            more + "}",
                                        "f"));
    const Bytes line = test::bytes_of("(1.000000) can0 001#" + data + "\n");
    return test::run_driver_over(driver, {{kStart, line}}).on<wheels_t>("WHEELS").at(0);
  };
  CHECK(wheels("", "FD01").speed_mps[0] == 3.0);
  CHECK(wheels("", "FD01").direction == wheels_t::DIRECTION_UNKNOWN);
  CHECK(wheels(", speeds_signed: true", "FD01").speed_mps[0] == -3.0);
  CHECK(wheels("", "0301").has_yaw_rate);
  CHECK_FALSE(wheels("", "0302").has_yaw_rate);
  CHECK(wheels(", max_yaw_rate_radps: 20", "0302").yaw_rate_radps == 20.0);
}

}  // namespace
}  // namespace roadfix
