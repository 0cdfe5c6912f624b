#include "drivers/protocols/rtcm.h"

#include <catch2/catch.hpp>

#include "drivers/protocols/checksums.h"
#include "support/device_bytes.h"

namespace roadfix {
namespace {

TEST_CASE("CRC-24Q has its published check value, and passes the standard's example") {
  CHECK(crc24q(test::bytes_of("123456789")) == 0xCDE703);  // reveng's catalogue of CRC algorithms, CRC-24/LTE-A
  // RTCM 10403.x, section 4.2, example: message 1005 of station 2003.
  const test::Bytes example =
      test::from_hex("D3 00 13 3E D7 D3 02 02 98 0E DE EF 34 B4 BD 62 AC 09 41 98 6F 33 36 0B 98");
  const Probe probe = probe_rtcm(example);
  CHECK(probe.fit == Fit::kFrame);
  CHECK(probe.size == example.size());
  for (std::size_t i = 3; i < example.size(); ++i) {
    test::Bytes wrong = example;
    wrong[i] ^= 1U;
    CHECK(probe_rtcm(wrong).fit == Fit::kBadChecksum);
  }
}

TEST_CASE("reserved bits that are set, short and empty frames") {
  CHECK(probe_rtcm(test::from_hex("D3 04 00")).fit == Fit::kNoFrame);
  CHECK(probe_rtcm(test::from_hex("D3")).fit == Fit::kIncomplete);
  const test::Bytes empty = test::rtcm_bytes({});
  CHECK(probe_rtcm(empty).fit == Fit::kFrame);
}

}  // namespace
}  // namespace roadfix
