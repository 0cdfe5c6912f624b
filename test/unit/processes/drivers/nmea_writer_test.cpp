#include "drivers/protocols/nmea_writer.h"

#include <catch2/catch.hpp>
#include <limits>

#include "drivers/protocols/utc.h"
#include "support/device_bytes.h"

namespace roadfix {
namespace {

using test::Bytes;

NmeaPose full_pose() {
  NmeaPose p;
  p.t_us = *utc_us(2026, 11, 24, 9, 27, 50) + 125'000;
  p.quality = NmeaQuality::kRtkFixed;
  p.position = NmeaPosition{48.1370013512, -11.5755210177};
  p.height_msl_m = 519.37;
  p.geoid_separation_m = 45.61;
  p.num_satellites = 17;
  p.correction_age_s = 1.0;
  p.speed_mps = 13.9;
  p.course_deg = -12.5;
  p.heading_deg = 371.25;
  p.deviations = NmeaDeviations{0.5, 0.2, 30.0, 0.45, 0.3, 0.9};
  return p;
}

std::vector<std::string> all(const NmeaPose& p) {
  return {write_gga(p, "GN"), write_rmc(p, "GN"), write_vtg(p, "GN"),
          write_hdt(p, "GN"), write_gst(p, "GN"), write_zda(p, "GN")};
}

/// Read by the parser of the receiver driver, which knows nothing of the writer.
struct Read {
  explicit Read(const std::string& text) : bytes(test::bytes_of(text)), sentence(parse()) {}
  NmeaSentence parse() {
    const Probe probe = probe_nmea(bytes);
    REQUIRE(probe.fit == Fit::kFrame);
    REQUIRE(probe.size == bytes.size());
    return nmea_sentence(bytes);
  }
  Bytes bytes;
  NmeaSentence sentence;
};

TEST_CASE("nmea writer: what is written is what the receiver driver reads") {
  const NmeaPose p = full_pose();
  const int64_t time_us = p.t_us % kMicrosPerDay;
  const Read gga_text(write_gga(p, "GN"));
  const auto gga = parse_gga(gga_text.sentence);
  REQUIRE(gga);
  CHECK(gga->time_of_day_us == time_us);
  CHECK(gga->quality == 4);
  REQUIRE(gga->position);
  CHECK(gga->position->lat_deg == Approx(p.position->lat_deg).margin(1e-8));
  CHECK(gga->position->lon_deg == Approx(p.position->lon_deg).margin(1e-8));
  CHECK(gga->num_satellites == 17);
  CHECK_FALSE(gga->hdop);
  CHECK(*gga->height_msl_m == Approx(519.37));
  CHECK(*gga->geoid_separation_m == Approx(45.61));
  CHECK(*gga->correction_age_s == Approx(1.0));
  const Read rmc_text(write_rmc(p, "GN"));
  const auto rmc = parse_rmc(rmc_text.sentence);
  REQUIRE(rmc);
  CHECK(rmc->valid);
  CHECK(rmc->time_of_day_us == time_us);
  CHECK(*rmc->speed_mps == Approx(13.9).margin(3e-4));
  CHECK(*rmc->course_deg == Approx(347.5));
  CHECK(rmc_text.sentence.fields[8] == "241126");
  const Read vtg_text(write_vtg(p, "GN"));
  const auto vtg = parse_vtg(vtg_text.sentence);
  REQUIRE(vtg);
  CHECK(vtg->valid);
  CHECK(*vtg->speed_mps == Approx(13.9).margin(2e-4));
  const Read hdt(write_hdt(p, "IN"));
  CHECK(hdt.sentence.talker == "IN");
  CHECK(*parse_heading_deg(hdt.sentence) == Approx(11.25));
  const Read gst_text(write_gst(p, "GN"));
  const auto gst = parse_gst(gst_text.sentence);
  REQUIRE(gst);
  CHECK(gst->north_std_m == Approx(0.45));
  CHECK(gst->east_std_m == Approx(0.3));
  CHECK(gst->up_std_m == Approx(0.9));
  const Read zda(write_zda(p, "GN"));
  CHECK(zda.sentence.fields == std::vector<std::string_view>{"092750.125", "24", "11", "2026", "00", "00"});
}

TEST_CASE("nmea writer: without a position nothing of one is written") {
  NmeaPose p = full_pose();
  SECTION("the quality says so") { p.quality = NmeaQuality::kNone; }
  SECTION("there is none") { p.position.reset(); }
  SECTION("it is no number") { p.position->lat_deg = std::numeric_limits<double>::quiet_NaN(); }
  SECTION("it is nowhere") { p.position->lon_deg = 180.5; }
  p.heading_deg.reset();
  const std::vector<std::string> texts = all(p);
  CHECK(texts[0] == "$GNGGA,092750.125,,,,,0,,,,M,,M,,*69\r\n");
  CHECK(texts[1].starts_with("$GNRMC,092750.125,V,,,,,,,241126,,,N,V*"));
  CHECK(texts[2].starts_with("$GNVTG,,T,,M,,N,,K,N*"));
  CHECK(texts[3].starts_with("$GNHDT,,T*"));
  CHECK(texts[4].starts_with("$GNGST,092750.125,,,,,,,*"));
  const Read gga(texts[0]);
  CHECK(parse_gga(gga.sentence)->quality == 0);
  CHECK_FALSE(parse_gga(gga.sentence)->position);
  const Read rmc(texts[1]);
  CHECK_FALSE(parse_rmc(rmc.sentence)->valid);
}

TEST_CASE("nmea writer: dead reckoning is quality 6 and mode E") {
  NmeaPose p = full_pose();
  p.quality = NmeaQuality::kDeadReckoning;
  const Read gga(write_gga(p, "GN")), rmc(write_rmc(p, "GN")), vtg(write_vtg(p, "GN"));
  CHECK(gga.sentence.fields[5] == "6");
  CHECK(rmc.sentence.fields[11] == "E");
  CHECK(vtg.sentence.fields[8] == "E");
  p.quality = NmeaQuality::kRtkFloat;
  CHECK(write_gga(p, "GN").find(",E,5,") == std::string::npos);  // west of Greenwich
  CHECK(write_gga(p, "GN").find(",W,5,") != std::string::npos);
  CHECK(write_rmc(p, "GN").find(",F,V*") != std::string::npos);
}

TEST_CASE("nmea writer: rounding carries, at sixty minutes, midnight, north and the poles") {
  NmeaPose p = full_pose();
  p.position = NmeaPosition{47.99999999999, 179.9999999999};
  CHECK(write_gga(p, "GN").find(",4800.000000,N,18000.000000,E,") != std::string::npos);
  p.position = NmeaPosition{-90.0, 0.0};
  CHECK(write_gga(p, "GN").find(",9000.000000,S,00000.000000,E,") != std::string::npos);
  p.heading_deg = 359.9999;
  CHECK(write_hdt(p, "GN").starts_with("$GNHDT,0.000,T"));
  p.t_us = *utc_us(2024, 2, 28, 23, 59, 59) + 999'700;
  CHECK(write_zda(p, "GN").starts_with("$GNZDA,000000.000,29,02,2024,"));
  CHECK(write_rmc(p, "GN").find(",290224,") != std::string::npos);
  p.t_us = *utc_us(2024, 2, 28, 23, 59, 59) + 999'400;
  CHECK(write_zda(p, "GN").starts_with("$GNZDA,235959.999,28,02,2024,"));
}

TEST_CASE("nmea writer: a sentence is never longer than 82 characters") {
  NmeaPose p = full_pose();
  p.position = NmeaPosition{-89.999999, -179.999999};
  p.height_msl_m = 8848.86;
  p.geoid_separation_m = -106.21;
  p.num_satellites = 120;
  p.correction_age_s = 59.0;
  p.speed_mps = 340.0;
  p.deviations = NmeaDeviations{1234.5678, 1234.5678, 179.99, 1234.5678, 1234.5678, 1234.5678};
  for (const std::string& text : all(p)) CHECK(text.size() <= 82);
  p.height_msl_m = 1e300;
  p.speed_mps = std::numeric_limits<double>::infinity();
  p.correction_age_s = -std::numeric_limits<double>::infinity();
  for (const std::string& text : all(p)) CHECK(text.size() <= 82);
  CHECK(write_gga(p, "GN").find(",99,,,M,-106.21,M,,*") != std::string::npos);
}

}  // namespace
}  // namespace roadfix
