#include "drivers/protocols/nmea.h"

#include <catch2/catch.hpp>

#include "support/device_bytes.h"

namespace roadfix {
namespace {

using test::Bytes;

/// The bytes must outlive the sentence.
NmeaSentence sentence_of(const Bytes& bytes) {
  REQUIRE(probe_nmea(bytes).fit == Fit::kFrame);
  return nmea_sentence(bytes);
}

// Published: the example of Wikipedia's "NMEA 0183"; a Trimble reference page (GST, VTG, HDT); the tests of
// github.com/robotika/osgar (a ZED-F9P's GGA).
const Bytes kGga = test::bytes_of("$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76\r\n");
const Bytes kRmc = test::bytes_of("$GPRMC,092750.000,A,5321.6802,N,00630.3372,W,0.02,31.66,280511,,,A*43\r\n");
const Bytes kGsa = test::bytes_of("$GPGSA,A,3,10,07,05,02,29,04,08,13,,,,,1.72,1.03,1.38*0A\r\n");
const Bytes kLongGga =
    test::bytes_of("$GNGGA,190615.40,5007.70786799,N,01422.49430110,E,2,09,1.9,290.1985,M,45.0552,M,01,0533*73\r\n");
const Bytes kVtg = test::bytes_of("$GPVTG,054.7,T,034.4,M,005.5,N,010.2,K*48\r\n");
const Bytes kHdt = test::bytes_of("$GPHDT,274.07,T*03\r\n");
const Bytes kGst = test::bytes_of("$GPGST,024603.00,3.2,6.6,4.7,47.3,5.8,5.6,22.0*58\r\n");

TEST_CASE("published sentences pass with their checksums, and no others") {
  for (const Bytes& bytes : {kGga, kRmc, kGsa, kLongGga, kVtg, kHdt, kGst}) {
    CHECK(probe_nmea(bytes).fit == Fit::kFrame);
    Bytes wrong = bytes;
    wrong[8] ^= 1U;
    CHECK(probe_nmea(wrong).fit == Fit::kBadChecksum);
  }
  CHECK(probe_nmea(test::bytes_of("$GPGGA,1,2\r\n")).fit == Fit::kNoFrame);  // no checksum
  CHECK(probe_nmea(test::bytes_of("$GPGGA,1\0052*00\r\n")).fit == Fit::kNoFrame);
  CHECK(probe_nmea(test::bytes_of("$GPGG$GPGGA")).fit == Fit::kNoFrame);
  CHECK(probe_nmea(test::bytes_of("$GPHDT,274.07,T*03\n")).fit == Fit::kFrame);  // a line feed alone
  CHECK(probe_nmea(test::bytes_of("$GPHDT,274.07,T*03\rx")).fit == Fit::kNoFrame);
  CHECK(probe_nmea(test::bytes_of("$GPHDT,274.07,T*0x\r\n")).fit == Fit::kNoFrame);
  CHECK(probe_nmea(Bytes(300, '$')).fit == Fit::kNoFrame);
}

TEST_CASE("GGA: position, heights and what else it says") {
  const auto m = parse_gga(sentence_of(kGga));
  REQUIRE(m);
  CHECK(m->time_of_day_us == (9 * 3600 + 27 * 60 + 50) * int64_t{1'000'000});
  CHECK(m->quality == 1);
  REQUIRE(m->position);
  CHECK(m->position->lat_deg == Approx(53.3613366667).epsilon(1e-12));
  CHECK(m->position->lon_deg == Approx(-6.50562).epsilon(1e-12));
  CHECK(m->num_satellites == 8);
  CHECK(*m->hdop == Approx(1.03));
  CHECK(*m->height_msl_m == Approx(61.7));
  CHECK(*m->geoid_separation_m == Approx(55.2));
  CHECK_FALSE(m->correction_age_s);
  const auto fine = parse_gga(sentence_of(kLongGga));
  REQUIRE(fine);
  CHECK(fine->position->lat_deg == Approx(50.1284644665).epsilon(1e-13));
  CHECK(fine->position->lon_deg == Approx(14.374905018333333).epsilon(1e-13));
  CHECK(fine->time_of_day_us == (19 * 3600 + 6 * 60 + 15) * int64_t{1'000'000} + 400'000);
  CHECK(*fine->correction_age_s == 1.0);
}

TEST_CASE("RMC, VTG, GST, GSA and headings") {
  const auto rmc = parse_rmc(sentence_of(kRmc));
  REQUIRE(rmc);
  CHECK(rmc->valid);
  CHECK(*rmc->speed_mps == Approx(0.02 * 1852.0 / 3600.0));
  CHECK(*rmc->course_deg == Approx(31.66));
  const auto vtg = parse_vtg(sentence_of(kVtg));
  REQUIRE(vtg);
  CHECK(*vtg->speed_mps == Approx(10.2 / 3.6));
  CHECK(*vtg->course_deg == Approx(54.7));
  CHECK_FALSE(vtg->time_of_day_us);
  const auto gst = parse_gst(sentence_of(kGst));
  REQUIRE(gst);
  CHECK(gst->north_std_m == Approx(5.8));
  CHECK(gst->east_std_m == Approx(5.6));
  CHECK(gst->up_std_m == Approx(22.0));
  CHECK(*parse_gsa_pdop(sentence_of(kGsa)) == Approx(1.72));
  CHECK(*parse_heading_deg(sentence_of(kHdt)) == Approx(274.07));
  const Bytes measured = test::nmea_bytes("GNTHS,12.50,A"), simulated = test::nmea_bytes("GNTHS,12.50,S");
  CHECK(*parse_heading_deg(sentence_of(measured)) == Approx(12.5));
  CHECK_FALSE(parse_heading_deg(sentence_of(simulated)));
}

TEST_CASE("fields that are missing or malformed are no values") {
  const auto gga = [](const std::string& body) {
    const Bytes bytes = test::nmea_bytes("GPGGA," + body);
    return parse_gga(sentence_of(bytes));
  };
  CHECK(gga("000001,,,,,0,,,,M,,M,,")->position.has_value() == false);  // no fix
  CHECK_FALSE(gga("000001,,,,,1,,,,M,,M,,"));                           // a fix, but nowhere
  CHECK_FALSE(gga("246001,5321.6802,N,00630.3372,W,1,8,1,6,M,5,M,,"));
  CHECK_FALSE(gga("0927,5321.6802,N,00630.3372,W,1,8,1,6,M,5,M,,"));
  CHECK_FALSE(gga("092750,9100.0,N,00630.3372,W,1,8,1,6,M,5,M,,"));
  CHECK_FALSE(gga("092750,5360.0,N,00630.3372,W,1,8,1,6,M,5,M,,"));  // 60 minutes
  CHECK_FALSE(gga("092750,5321.6802,X,00630.3372,W,1,8,1,6,M,5,M,,"));
  CHECK_FALSE(gga("092750,5321.6802,N,0630.3372,W,1,8,1,6,M,5,M,,"));  // two digits of degrees
  CHECK_FALSE(gga("092750,-521.6802,N,00630.3372,W,1,8,1,6,M,5,M,,"));
  CHECK_FALSE(gga("092750,5321.6802,N,00630.3372,W,9,8,1,6,M,5,M,,"));
  const auto odd = gga("092750,5321.6802,N,00630.3372,W,4,x,nan,inf,M,1e5,M,-1,");
  REQUIRE(odd);
  CHECK_FALSE(odd->num_satellites);
  CHECK_FALSE(odd->hdop);
  CHECK_FALSE(odd->height_msl_m);
  CHECK_FALSE(odd->geoid_separation_m);
  CHECK_FALSE(odd->correction_age_s);
  CHECK_FALSE(gga("092750.5"));  // nothing but a time
}

TEST_CASE("addresses: talker and type, proprietary and short ones") {
  const Bytes ubx = test::nmea_bytes("PUBX,00,1"), tiny = test::nmea_bytes("A"), gn = test::nmea_bytes("GNGLL,");
  CHECK(sentence_of(ubx).type == "PUBX");
  CHECK(sentence_of(ubx).fields.size() == 2);
  CHECK(sentence_of(tiny).type == "A");
  CHECK(sentence_of(tiny).fields.empty());
  CHECK(sentence_of(gn).talker == "GN");
  CHECK(sentence_of(gn).fields == std::vector<std::string_view>{""});
}

}  // namespace
}  // namespace roadfix
