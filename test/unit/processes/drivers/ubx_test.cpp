#include "drivers/protocols/ubx.h"

#include <catch2/catch.hpp>

#include "drivers/protocols/utc.h"
#include "support/device_bytes.h"

namespace roadfix {
namespace {

using test::Bytes;

/// A NAV-PVT and a NAV-RELPOSNED of an u-blox M8P in Prague, as the tests of github.com/robotika/osgar publish them.
const Bytes kPublishedPvt = test::from_hex(
    "b56201075c0000260818e207041a0f3b1df7e9030000f51ae60b0343ea0e4060910894fae01dd2f10400ad44040027000000"
    "31000000eeffffff04000000e2ffffff12000000d56592012000000053cc2c00a20000001219263b00000000000000005703");
const Bytes kPublishedRelPos =
    test::from_hex("b562013c28000000000000260818d90a00004eebffff5dffffff56d0d000f600000029010000ea0100000f0000002fc6");

UbxFrame whole(const Bytes& bytes) {
  const Probe probe = probe_ubx(bytes);
  REQUIRE(probe.fit == Fit::kFrame);
  REQUIRE(probe.size == bytes.size());
  return ubx_frame(bytes);
}

TEST_CASE("the checksum agrees with published frames") {
  // ACK-ACK to CFG-MSG, README of github.com/semuconsulting/pyubx2; the poll of NAV-PVT, in many integration manuals.
  CHECK(probe_ubx(test::from_hex("b562 0501 0200 0601 0f38")).fit == Fit::kFrame);
  CHECK(probe_ubx(test::from_hex("b562 0107 0000 0819")).fit == Fit::kFrame);
  CHECK(probe_ubx(test::from_hex("b562 0107 0000 0818")).fit == Fit::kBadChecksum);
  CHECK(probe_ubx(kPublishedPvt).fit == Fit::kFrame);
  CHECK(probe_ubx(kPublishedRelPos).fit == Fit::kFrame);
}

TEST_CASE("a published NAV-PVT says where and when it was") {
  const UbxFrame frame = whole(kPublishedPvt);
  REQUIRE(frame.is(kUbxNav, kUbxNavPvt));
  const auto m = parse_nav_pvt(frame.payload);
  REQUIRE(m);
  CHECK(m->time_of_week_ms == 403187200);
  REQUIRE(m->utc_us);
  // 2018-04-26 15:59:29 + 199629.557 us
  CHECK(*m->utc_us == *utc_us(2018, 4, 26, 15, 59, 29) + 199630);
  CHECK(m->fix_type == 3);
  CHECK(m->fix_ok);
  CHECK(m->differential);
  CHECK(m->carrier_solution == 1);
  CHECK(m->num_satellites == 14);
  CHECK(m->lon_1e7_deg == 143745088);
  CHECK(m->lat_1e7_deg == 501283476);
  CHECK(m->height_mm == 324050);
  CHECK(m->horizontal_accuracy_mm == 39);
  CHECK(m->vertical_accuracy_mm == 49);
  CHECK(m->velocity_ned_mmps[0] == -18);
  CHECK(m->velocity_ned_mmps[2] == -30);
  CHECK(m->speed_accuracy_mmps == 32);
  CHECK(m->pdop_1e2 == 162);
}

TEST_CASE("a published NAV-RELPOSNED of version 0 gives the vector and its heading") {
  const auto m = parse_nav_relposned(whole(kPublishedRelPos).payload);
  REQUIRE(m);
  // 2777 cm + 8.6 mm north, -5298 cm - 4.8 mm east, -163 cm - 4.8 mm down
  CHECK(m->north_m == Approx(27.77 + 0.0086));
  CHECK(m->east_m == Approx(-52.98 - 0.0048));
  CHECK(m->down_m == Approx(-1.63 - 0.0048));
  CHECK(m->heading_deg == Approx(297.666).margin(0.01));
  CHECK(m->heading_valid);
  CHECK(m->carrier_solution == 1);
  CHECK_FALSE(m->moving_base);
}

TEST_CASE("NAV-RELPOSNED of version 1 brings its own heading") {
  constexpr uint32_t kValid = 1U << 2U, kFixed = 2U << 3U, kMoving = 1U << 5U, kHeading = 1U << 8U;
  test::Payload p(64);
  p.at<uint8_t>(0, 1).at<uint32_t>(4, 1000).at<int32_t>(8, 100).at<int8_t>(32, 25);
  p.at<int32_t>(20, 104).at<int8_t>(35, -3).at<int32_t>(24, 27'012'345).at<uint32_t>(52, 12'345);
  p.at<uint32_t>(60, kValid | kFixed | kMoving | kHeading);
  const auto m = parse_nav_relposned(p.bytes());
  REQUIRE(m);
  CHECK(m->north_m == Approx(1.0025));
  CHECK(m->length_m == Approx(1.0397));
  CHECK(m->heading_deg == Approx(270.12345));
  CHECK(m->heading_accuracy_deg == Approx(0.12345));
  CHECK(m->carrier_solution == 2);
  CHECK(m->moving_base);
  CHECK(m->heading_valid);
  p.at<uint32_t>(60, kValid | kFixed | kMoving);
  CHECK_FALSE(parse_nav_relposned(p.bytes())->heading_valid);
  p.at<uint8_t>(0, 2);
  CHECK_FALSE(parse_nav_relposned(p.bytes()));
}

TEST_CASE("a payload of the wrong length is none") {
  for (std::size_t size = 0; size < 130; ++size) {
    CHECK(parse_nav_pvt(Bytes(size)).has_value() == (size == 92));
    CHECK(parse_nav_relposned(Bytes(size)).has_value() == (size == 40));  // version 0, as the zeros say
    CHECK(parse_nav_eoe(Bytes(size)).has_value() == (size == 4));
  }
}

TEST_CASE("without date and time there is no UTC, and the 60 of a leap second is the next minute") {
  test::Payload p(92);
  p.at<uint16_t>(4, 2016).at<uint8_t>(6, 12).at<uint8_t>(7, 31).at<uint8_t>(8, 23).at<uint8_t>(9, 59).at<uint8_t>(10,
                                                                                                                  60);
  CHECK_FALSE(parse_nav_pvt(p.bytes())->utc_us);
  p.at<uint8_t>(11, 3).at<int32_t>(16, -250'000'000);
  CHECK(parse_nav_pvt(p.bytes())->utc_us == *utc_us(2017, 1, 1, 0, 0, 0) - 250'000);
  p.at<uint8_t>(6, 2);  // there is no 31 February
  CHECK_FALSE(parse_nav_pvt(p.bytes())->utc_us);
  CHECK_FALSE(ubx_correction_age_s(0));
  CHECK(ubx_correction_age_s(3) == 5.0);
  CHECK(*ubx_correction_age_s(15) > 120.0);
}

TEST_CASE("a time of day belongs to the day that is nearest") {
  const int64_t noon = *utc_us(2024, 5, 3, 12, 0, 0);
  const int64_t hour = kMicrosPerDay / 24;
  CHECK(nearest_day(12 * hour, noon) == noon);
  CHECK(nearest_day(kMicrosPerDay - 1, *utc_us(2024, 5, 3, 0, 0, 0)) == *utc_us(2024, 5, 3, 0, 0, 0) - 1);
  CHECK(nearest_day(5, *utc_us(2024, 5, 3, 23, 59, 59)) == *utc_us(2024, 5, 4, 0, 0, 0) + 5);
}

}  // namespace
}  // namespace roadfix
