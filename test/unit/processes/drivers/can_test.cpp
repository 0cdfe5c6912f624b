#include <catch2/catch.hpp>

#include "drivers/protocols/can_signal.h"
#include "drivers/protocols/candump.h"
#include "support/device_bytes.h"

namespace roadfix {
namespace {

CanFrame frame_of(const std::string& line) {
  CanFrame frame;
  REQUIRE(parse_can_line(test::bytes_of(line), frame));
  return frame;
}

bool refused(const std::string& line) {
  CanFrame frame;
  return !parse_can_line(test::bytes_of(line), frame);
}

TEST_CASE("a line of candump is a frame, and the frame the line") {
  // The manual page of candump shows the first one.
  const CanFrame frame = frame_of("(1436509052.249713) vcan0 044#2A366C2BBA\n");
  CHECK(frame.t_us == 1436509052249713);
  CHECK(frame.id == 0x44);
  CHECK_FALSE(frame.extended);
  REQUIRE(frame.size == 5);
  CHECK(frame.data[0] == 0x2A);
  CHECK(frame.data[4] == 0xBA);
  for (const std::string line :
       {"(1436509052.249713) vcan0 044#2A366C2BBA\n", "(0.000001) can0 18FEF100#\n", "(1.500000) can1 7FF#R\n",
        "(1.500000) can1 20000004#0010000000000000\n", "(9.000000) can0 123##0000102030405060708\n"}) {
    const std::string interface = line.substr(line.find(' ') + 1, line.rfind(' ') - line.find(' ') - 1);
    CHECK(can_line(frame_of(line), interface) == line);
  }
  CHECK(frame_of("(1.500000) can1 20000004#0010").error);
  CHECK(frame_of("(1.000000) can0 001#").size == 0);
}

TEST_CASE("lines that candump does not write are refused") {
  for (const std::string line :
       {"", "\n", "(1.000000) can0", "(1.000000) 123#00", "1.000000 can0 123#00", "(1.0000) can0 123#00",
        "(-1.000000) can0 123#00", "(1.000000) can0 12#00", "(1.000000) can0 FFF#00", "(1.000000) can0 123#0",
        "(1.000000) can0 123#000102030405060708", "(1.000000) can0 123#0G", "(1.000000) can0 123##",
        "(99999999999999.000000) can0 123#00", "(1.000000) can0 123 [1] 00"}) {
    CHECK(refused(line));
  }
}

double at(CanSignal signal, const std::string& data) {
  const auto value = value_of(signal, test::from_hex(data));
  REQUIRE(value);
  return *value;
}

TEST_CASE("signals in both byte orders, signed and unsigned") {
  CanSignal s;
  s.start_bit = 0;
  s.length = 16;
  CHECK(at(s, "34 12") == 0x1234);
  s.byte_order = CanByteOrder::kBig;
  s.start_bit = 7;  // the top bit of the first byte, as DBC counts
  CHECK(at(s, "12 34") == 0x1234);
  s.start_bit = 3;
  s.length = 12;
  CHECK(at(s, "F2 34") == 0x234);
  s.is_signed = true;
  CHECK(at(s, "FF FF") == -1);
  CHECK(at(s, "F7 FF") == 2047);
  s = {};
  s.start_bit = 4;
  s.length = 12;
  s.factor = 0.1;
  s.offset = -40.0;
  CHECK(at(s, "50 01") == Approx(0.1 * 0x15 - 40.0));
  s = {};
  s.length = 64;
  CHECK(at(s, "FF FF FF FF FF FF FF FF") == Approx(18446744073709551615.0));
  s.is_signed = true;
  CHECK(at(s, "FF FF FF FF FF FF FF FF") == -1);
}

TEST_CASE("little-endian signals: every place and length reads the number that was written") {
  for (int start = 0; start < 64; ++start) {
    for (int length = 1; start + length <= 64; ++length) {
      const uint64_t number = 0x9E3779B97F4A7C15U & (length == 64 ? ~uint64_t{0} : (uint64_t{1} << length) - 1);
      test::Payload data(8);
      data.at<uint64_t>(0, number << start);
      CanSignal s;
      s.start_bit = start;
      s.length = length;
      REQUIRE(static_cast<uint64_t>(*raw_value(s, data.bytes())) == number);
    }
  }
}

TEST_CASE("a frame that is too short, and a number that means not available") {
  CanSignal s;
  s.start_bit = 8;
  s.length = 16;
  CHECK_FALSE(value_of(s, test::from_hex("00 01")));
  CHECK(value_of(s, test::from_hex("00 01 02")));
  s.byte_order = CanByteOrder::kBig;
  s.start_bit = 15;
  CHECK_FALSE(value_of(s, test::from_hex("00 01")));
  s.invalid = {0xFFFF};
  CHECK_FALSE(value_of(s, test::from_hex("00 FF FF")));
  CHECK(value_of(s, test::from_hex("00 FF FE")));
}

TEST_CASE("identifiers in hex") {
  CHECK(parse_can_id("0x1A0") == CanId{0x1A0, false});
  CHECK(parse_can_id("7ff") == CanId{0x7FF, false});
  CHECK(parse_can_id("800") == CanId{0x800, true});
  CHECK(parse_can_id("000001A0") == CanId{0x1A0, true});
  for (const std::string text : {"", "0x", "0xG1", "20000000", "-1"}) CHECK_FALSE(parse_can_id(text));
}

}  // namespace
}  // namespace roadfix
