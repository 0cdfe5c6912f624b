#include <catch2/catch.hpp>
#include <random>
#include <roadfix/gnss_t.hpp>

#include "config/config.h"
#include "drivers/gnss_driver/handler.h"
#include "drivers/protocols/utc.h"
#include "support/driver_run.h"
#include "support/receiver_bytes.h"

namespace roadfix {
namespace {

using test::Bytes;
using test::RawRead;

const int64_t kStart = *utc_us(2024, 5, 3, 23, 59, 58);  // over midnight
constexpr int64_t kPath_us = 40'000;                     // from validity to the first byte read

/// 5 Hz; each epoch in one read, as late as the path is.
std::vector<RawRead> ubx_drive(int epochs, bool with_heading) {
  std::vector<RawRead> reads;
  for (int i = 0; i < epochs; ++i) {
    const int64_t utc = kStart + int64_t{200'000} * i;
    const auto tow = static_cast<uint32_t>(1000 + 200 * i);
    Bytes bytes = test::pvt_bytes(utc, tow, 48.0 + 1e-5 * i);
    if (with_heading) test::append(bytes, test::relposned_bytes(tow, 100.0));
    reads.push_back({utc + kPath_us, bytes});
  }
  return reads;
}

GnssDriverConfig config() {
  GnssDriverConfig c;
  c.device.device = "pty:";
  return c;
}

TEST_CASE("UBX: a fix in east, north, up, above the ellipsoid, at its time") {
  GnssDriverConfig c = config();
  c.latency = 1e-6 * kPath_us;
  GnssDriver driver(c);
  const auto fixes = test::run_driver_over(driver, ubx_drive(20, false)).on<gnss_t>("GNSS");
  REQUIRE(fixes.size() == 20);
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    const gnss_t& m = fixes[i];
    CHECK(std::abs(m.utime - (kStart + int64_t{200'000} * static_cast<int64_t>(i))) <= 1);
    CHECK(m.seq == static_cast<int64_t>(i));
    CHECK(m.fix_type == gnss_t::FIX_RTK_FIXED);
    CHECK(m.height_kind == gnss_t::HEIGHT_ELLIPSOID);
    CHECK(m.lat_deg == Approx(48.0 + 1e-5 * static_cast<double>(i)).margin(1e-7));
    CHECK(m.lon_deg == Approx(-3.25));
    CHECK(m.height_m == Approx(167.5));
    CHECK(m.cov_enu_m2[0][0] == Approx(0.014 * 0.014));
    CHECK(m.cov_enu_m2[2][2] == Approx(0.02 * 0.02));
    REQUIRE(m.has_velocity);
    CHECK(m.velocity_enu_mps[0] == Approx(2.0));
    CHECK(m.velocity_enu_mps[1] == Approx(1.0));
    CHECK(m.velocity_enu_mps[2] == Approx(0.3));
    CHECK(m.num_satellites == 17);
    CHECK(m.pdop == Approx(1.45));
    CHECK(m.correction_age_s == 2.0);
    CHECK_FALSE(m.has_heading);
  }
}

TEST_CASE("UBX: the heading of two antennas joins its fix, turned by the baseline's direction") {
  GnssDriverConfig c = config();
  c.moving_base = true;
  c.baseline_heading_deg = 110.0;
  GnssDriver driver(c);
  const auto fixes = test::run_driver_over(driver, ubx_drive(10, true)).on<gnss_t>("GNSS");
  REQUIRE(fixes.size() == 10);
  CHECK_FALSE(fixes[0].has_heading);  // not known yet that one comes
  for (std::size_t i = 1; i < fixes.size(); ++i) {
    REQUIRE(fixes[i].has_heading);
    CHECK(fixes[i].heading_deg == Approx(350.0));
    CHECK(fixes[i].heading_std_deg == Approx(0.2));
  }
  GnssDriver other(config());  // the vector to a base station says nothing of the vehicle
  for (const gnss_t& m : test::run_driver_over(other, ubx_drive(10, true)).on<gnss_t>("GNSS"))
    CHECK_FALSE(m.has_heading);
}

TEST_CASE("UBX: a heading that stops coming holds up three fixes at most") {
  GnssDriverConfig c = config();
  c.moving_base = true;
  GnssDriver driver(c);
  std::vector<RawRead> reads = ubx_drive(5, true);
  const std::vector<RawRead> longer = ubx_drive(12, false);
  reads.insert(reads.end(), longer.begin() + 5, longer.end());
  test::CollectedSensors outputs;
  outputs.begin(1);
  driver.opened(0);
  std::vector<std::size_t> count;
  for (const RawRead& read : reads) {
    driver.take(0, read.utime, read.bytes, outputs);
    count.push_back(outputs.sent.size());
  }
  CHECK(count.back() == 12);
  CHECK(count[5] == 5);   // waits
  CHECK(count[9] == 10);  // does not wait any more
}

std::vector<gnss_t> nmea_fixes(bool gst, const std::string& quality, const std::string& heights) {
  std::vector<RawRead> reads;
  for (int i = 0; i < 20; ++i) {
    const int64_t utc = kStart + int64_t{200'000} * i;
    reads.push_back({utc + kPath_us, test::nmea_epoch_bytes(utc, gst, quality, heights)});
  }
  GnssDriverConfig c = config();
  c.latency = 1e-6 * kPath_us;
  GnssDriver driver(c);
  return test::run_driver_over(driver, reads).on<gnss_t>("GNSS");
}

TEST_CASE("NMEA: the sentences of one moment make one fix, over midnight too") {
  const auto fixes = nmea_fixes(true, "4", "120.0,M,47.5,M");
  REQUIRE(fixes.size() == 20);
  for (std::size_t i = 2; i < fixes.size(); ++i) {
    const gnss_t& m = fixes[i];
    CHECK(std::abs(m.utime - (kStart + int64_t{200'000} * static_cast<int64_t>(i))) <= 1);
    CHECK(m.fix_type == gnss_t::FIX_RTK_FIXED);
    CHECK(m.height_kind == gnss_t::HEIGHT_ELLIPSOID);
    CHECK(m.height_m == Approx(167.5));
    CHECK(m.lat_deg == Approx(48.0));
    CHECK(m.lon_deg == Approx(-3.25));
    CHECK(m.cov_enu_m2[0][0] == Approx(0.16));  // east
    CHECK(m.cov_enu_m2[1][1] == Approx(0.09));
    REQUIRE(m.has_velocity);
    CHECK(m.velocity_enu_mps[0] == Approx(-10.0));
    CHECK(m.velocity_enu_mps[1] == Approx(0.0).margin(1e-9));
    CHECK(m.cov_velocity_enu_m2ps2[2][2] > 1e3);  // nothing measures the vertical
    CHECK(m.pdop == Approx(2.5));
  }
}

TEST_CASE("NMEA: without GST the sigma comes from HDOP, without the geoid the height is above the sea") {
  const auto fixes = nmea_fixes(false, "1", "120.0,M,,M");
  REQUIRE(fixes.size() >= 19);
  CHECK(fixes[5].cov_enu_m2[0][0] == Approx(4.5 * 4.5));
  CHECK(fixes[5].cov_enu_m2[2][2] == Approx(81.0));
  CHECK(fixes[5].height_kind == gnss_t::HEIGHT_MSL);
  CHECK(fixes[5].height_m == Approx(120.0));
  CHECK(nmea_fixes(false, "0", ",M,,M")[5].fix_type == gnss_t::FIX_NONE);
}

TEST_CASE("NMEA beside UBX is not a second fix") {
  GnssDriver driver(config());
  std::vector<RawRead> reads = ubx_drive(10, false);
  for (int i = 0; i < 10; ++i)
    test::append(reads[static_cast<std::size_t>(i)].bytes,
                 test::nmea_epoch_bytes(kStart + int64_t{200'000} * i, true, "1", "1,M,1,M"));
  CHECK(test::run_driver_over(driver, reads).sent.size() == 10);
}

TEST_CASE("the computer's clock may be wrong: mapped stamps follow it, utc ones are refused") {
  constexpr int64_t kOff = 3'000'000'000;  // 50 minutes
  std::vector<RawRead> reads = ubx_drive(10, false);
  for (RawRead& read : reads) read.utime += kOff;
  GnssDriver mapped(config());
  const auto fixes = test::run_driver_over(mapped, reads).on<gnss_t>("GNSS");
  REQUIRE(fixes.size() == 10);
  CHECK(std::abs(fixes[9].utime - (kStart + kOff + kPath_us + 9 * 200'000)) <= 1);
  GnssDriverConfig c = config();
  c.time = GnssTime::kUtc;
  GnssDriver utc(c);
  CHECK(test::run_driver_over(utc, reads).sent.empty());
  GnssDriver right(c);
  CHECK(test::run_driver_over(right, ubx_drive(3, false)).on<gnss_t>("GNSS")[2].utime == kStart + 400'000);
}

TEST_CASE("however the stream is cut, the messages are the same but for the times of reading") {
  Bytes stream;
  for (const RawRead& read : ubx_drive(3, true)) test::append(stream, read.bytes);
  test::append(stream, test::nmea_epoch_bytes(kStart, true, "1", "1,M,1,M"));
  GnssDriverConfig c = config();
  c.time = GnssTime::kUtc;
  c.max_clock_error = 10.0;
  c.moving_base = true;
  GnssDriver whole(c);
  const auto expected = test::run_driver_over(whole, {{kStart, stream}}).sent;
  REQUIRE(expected.size() == 3);
  for (std::size_t cut = 0; cut <= stream.size(); ++cut) {
    const auto at = stream.begin() + static_cast<std::ptrdiff_t>(cut);
    GnssDriver driver(c);
    REQUIRE(test::run_driver_over(driver, {{kStart, {stream.begin(), at}}, {kStart, {at, stream.end()}}}).sent ==
            expected);
  }
}

TEST_CASE("noise on the line loses single fixes, never order, and is counted") {
  std::mt19937 random(11);
  std::vector<RawRead> reads = ubx_drive(200, false);
  for (RawRead& read : reads)
    for (uint8_t& byte : read.bytes)
      if (random() % 500 == 0) byte = static_cast<uint8_t>(random());
  GnssDriver driver(config());
  const auto fixes = test::run_driver_over(driver, reads).on<gnss_t>("GNSS");
  CHECK(fixes.size() > 140);
  CHECK(fixes.size() < 200);
  for (std::size_t i = 1; i < fixes.size(); ++i) CHECK(fixes[i].utime > fixes[i - 1].utime);
  const auto rows = driver.counters();
  CHECK(rows[0].used == static_cast<int64_t>(fixes.size()));
  CHECK(rows[0].skipped_bytes > 0);
  CHECK(rows[1].bad_checksum > 0);
}

TEST_CASE("a caster is told the position in a sentence that parses") {
  GnssDriver driver(config());
  CHECK_FALSE(driver.position_for_caster(kStart));
  static_cast<void>(test::run_driver_over(driver, ubx_drive(3, false)));
  const auto text = driver.position_for_caster(kStart);
  REQUIRE(text);
  const Bytes bytes = test::bytes_of(*text);
  REQUIRE(probe_nmea(bytes).fit == Fit::kFrame);
  const auto gga = parse_gga(nmea_sentence(bytes));
  REQUIRE(gga);
  CHECK(gga->position->lat_deg == Approx(48.00002).margin(1e-5));
  CHECK(gga->position->lon_deg == Approx(-3.25));
  CHECK(gga->time_of_day_us == kStart % kMicrosPerDay);
}

TEST_CASE("gnss_driver.yaml is strict") {
  CHECK_THROWS_WITH(parse_config<GnssDriverConfig>("baud: 9600", "f"), Catch::Contains("device"));
  CHECK_THROWS_WITH(parse_config<GnssDriverConfig>("{device: 'pty:', bauds: 9600}", "f"), Catch::Contains("baud"));
  const auto c = parse_config<GnssDriverConfig>("{device: 'tcp:h:1', time: utc, ntrip: {host: h, mountpoint: M}}", "f");
  CHECK(c.ntrip->port == 2101);
  CHECK(config_text(parse_config<GnssDriverConfig>(config_text(c), "f")) == config_text(c));
}

}  // namespace
}  // namespace roadfix
