#include <catch2/catch.hpp>
#include <roadfix/wheels_t.hpp>

#include "config/config.h"
#include "drivers/wheel_driver/handler.h"
#include "support/driver_run.h"

namespace roadfix {
namespace {

using test::Bytes;
using test::RawRead;

constexpr int64_t kStart = 1'436'509'052'249'713;

const char* const kMapping = R"(
device: "candump:drive.log"
speeds:                       # km/h in steps of 0.01, Motorola
  - {frame: "0x1A0", start_bit: 7, length: 16, byte_order: big, factor: 0.002777777777777778, invalid: [65535]}
  - {frame: "0x1A0", start_bit: 23, length: 16, byte_order: big, factor: 0.002777777777777778, invalid: [65535]}
  - {frame: "0x1A1", start_bit: 7, length: 16, byte_order: big, factor: 0.002777777777777778, invalid: [65535]}
  - {frame: "0x1A1", start_bit: 23, length: 16, byte_order: big, factor: 0.002777777777777778, invalid: [65535]}
direction: {frame: "0x2B0", start_bit: 0, length: 3}
forward: [1, 2, 3]
reverse: [7]
yaw_rate: {frame: "18FEF100", start_bit: 0, length: 16, signed: true, factor: 0.001}
)";

WheelDriverConfig mapping() { return parse_config<WheelDriverConfig>(kMapping, "wheel_driver.yaml"); }

std::string line(int64_t t_us, const std::string& frame) {
  char text[128];
  std::snprintf(text, sizeof text, "(%lld.%06lld) can0 %s\n", static_cast<long long>(t_us / 1'000'000),
                static_cast<long long>(t_us % 1'000'000), frame.c_str());
  return text;
}

/// 3600, 3610, 3620, 3630 steps of 0.01 km/h are 10 m/s and a little more.
std::string moment(int64_t t_us, const std::string& gear = "2B0#01") {
  return line(t_us - 2000, gear) + line(t_us - 1500, "18FEF100#9CFF") + line(t_us - 1000, "1A0#0E100E1A") +
         line(t_us, "1A1#0E240E2E");
}

std::vector<wheels_t> run(const std::vector<std::string>& texts) {
  std::vector<RawRead> reads;
  for (std::size_t i = 0; i < texts.size(); ++i)
    reads.push_back({kStart + int64_t{20'000} * static_cast<int64_t>(i), test::bytes_of(texts[i])});
  WheelDriver driver(mapping());
  return test::run_driver_over(driver, reads).on<wheels_t>("WHEELS");
}

TEST_CASE("four speeds out of two frames make one message with direction and yaw rate") {
  std::vector<std::string> texts;
  for (int i = 0; i < 20; ++i) texts.push_back(moment(kStart + int64_t{20'000} * i));
  const auto wheels = run(texts);
  REQUIRE(wheels.size() == 20);
  CHECK(std::abs(wheels[10].utime - (kStart + 200'000)) < 10);
  CHECK(wheels[10].num_speeds == 4);
  CHECK(wheels[10].speed_mps[0] == Approx(10.0));
  CHECK(wheels[10].speed_mps[3] == Approx(36.30 / 3.6));
  CHECK(wheels[10].direction == wheels_t::DIRECTION_FORWARD);
  REQUIRE(wheels[10].has_yaw_rate);
  CHECK(wheels[10].yaw_rate_radps == Approx(-0.1));
  CHECK(run({moment(kStart, "2B0#07")})[0].direction == wheels_t::DIRECTION_REVERSE);
  CHECK(run({moment(kStart, "2B0#00")})[0].direction == wheels_t::DIRECTION_UNKNOWN);
}

TEST_CASE("no message without all wheels: one missing, not available, too old") {
  CHECK(run({line(kStart, "1A0#0E100E1A")}).empty());
  CHECK(run({line(kStart, "1A0#0E10FFFF") + line(kStart, "1A1#0E240E2E")}).empty());
  CHECK(run({line(kStart, "1A0#0E10") + line(kStart, "1A1#0E240E2E")}).empty());  // too short
  std::vector<std::string> apart(16);                                             // 20 ms each
  apart.front() = line(kStart, "1A0#0E100E1A");
  apart.back() = line(kStart + 300'000, "1A1#0E240E2E");
  CHECK(run(apart).empty());
  CHECK(run({line(kStart, "1A0#0E100E1A") + line(kStart, "000001A1#0E240E2E")}).empty());  // another, longer identifier
  CHECK(run({line(kStart, "1A0#0E100E1A") + line(kStart, "1A1#R")}).empty());
  CHECK(run({line(kStart, "1A0#FFFEFFFE") + line(kStart, "1A1#0E240E2E")}).empty());  // 182 m/s
}

TEST_CASE("cut at every byte the messages are the same, and garbage is counted") {
  // The first read shows the clocks' offset; what one read brings after it is then stamped by the frames' own times.
  const RawRead first{kStart - 100'000, test::bytes_of(moment(kStart - 100'000))};
  const std::string text = "garbage\n" + moment(kStart) + "(x) can0 1\n" + moment(kStart + 20'000);
  for (std::size_t cut = 0; cut <= text.size(); ++cut) {
    WheelDriver driver(mapping());
    const RawRead head{kStart + 20'000, test::bytes_of(text.substr(0, cut))};
    const RawRead rest{kStart + 20'000, test::bytes_of(text.substr(cut))};
    const auto found = test::run_driver_over(driver, {first, head, rest}).on<wheels_t>("WHEELS");
    REQUIRE(found.size() == 3);
    REQUIRE(std::abs(found[1].utime - kStart) < 3000);
    REQUIRE(std::abs(found[2].utime - found[1].utime - 20'000) < 100);  // the creep of 0.1 s
    REQUIRE(driver.counters()[1].refused == 2);
  }
}

const char* const kCounter = R"(
device: "candump:drive.log"
speeds: [{frame: "0x1A0", start_bit: 0, length: 16, invalid: [65535]}]   # of the rear axle
speeds_signed: true
ticks: {ticks_per_turn: 100, wheel_radius_m: 0.3}
)";

/// A frame with a little-endian counter every 20 ms.
std::vector<wheels_t> run_counter(const std::vector<int>& readings, const std::string& config = kCounter) {
  std::vector<RawRead> reads;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const int64_t t_us = kStart + int64_t{20'000} * static_cast<int64_t>(i);
    char frame[16];
    std::snprintf(frame, sizeof frame, "1A0#%02X%02X", readings[i] & 0xFF, (readings[i] >> 8) & 0xFF);
    reads.push_back({t_us, test::bytes_of(line(t_us, frame))});
  }
  WheelDriver driver(parse_config<WheelDriverConfig>(config, "wheel_driver.yaml"));
  return test::run_driver_over(driver, reads).on<wheels_t>("WHEELS");
}

TEST_CASE("counters become speeds at the middle of their intervals, over the end of their range, in both directions") {
  constexpr double kTick_mps = 2.0 * 3.14159265358979 * 0.3 / 100.0 / 0.02;  // one tick in 20 ms
  const auto wheels = run_counter({65510, 65520, 65530, 4, 14, 9, 65532});
  REQUIRE(wheels.size() == 6);
  CHECK(wheels[2].num_speeds == 1);
  CHECK(wheels[2].direction == wheels_t::DIRECTION_SIGNED);
  CHECK(wheels[2].speed_mps[0] == Approx(10.0 * kTick_mps).epsilon(1e-3));  // 65530 to 4
  CHECK(std::abs(wheels[2].utime - (kStart + 50'000)) < 200);
  CHECK(wheels[4].speed_mps[0] == Approx(-5.0 * kTick_mps).epsilon(1e-3));
  CHECK(wheels[5].speed_mps[0] == Approx(-13.0 * kTick_mps).epsilon(1e-3));  // 9 to 65532
}

TEST_CASE("a counter that is not available or jumps gives no speed, and goes on behind it") {
  CHECK(run_counter({100, 110, 65535, 130, 140}).size() == 3);  // the gap's mean, 110 to 130, is one of them
  CHECK(run_counter({100, 110, 30000, 30010}).size() == 2);     // 28 km/s
  CHECK(run_counter({100}).empty());
}

TEST_CASE("counters with a factor, or of several lengths, are refused") {
  const auto refused = [](const std::string& text, const std::string& what) {
    CHECK_THROWS_WITH(parse_config<WheelDriverConfig>(text, "f"), Catch::Contains(what));
  };
  const std::string ticks = ", ticks: {ticks_per_turn: 100, wheel_radius_m: 0.3}}";
  refused("{device: 'pty:', speeds: [{frame: '1', length: 16, factor: 0.1}]" + ticks, "without factor");
  refused("{device: 'pty:', speeds: [{frame: '1', length: 16}, {frame: '1', length: 8}, {frame: '1'}, {frame: '1'}]" +
              ticks,
          "of one length");
  refused("{device: 'pty:', speeds: [{frame: '1'}], ticks: {wheel_radius_m: 0.3}}", "ticks_per_turn");
  refused("{device: 'pty:', speeds: [{frame: '1'}], ticks: {ticks_per_turn: 5, wheel_radius_m: 31}}", "wheel_radius_m");
}

TEST_CASE("a mapping that cannot be is refused with its key") {
  const auto refused = [](const std::string& text, const std::string& what) {
    CHECK_THROWS_WITH(parse_config<WheelDriverConfig>(text, "f"), Catch::Contains(what));
  };
  refused("device: 'pty:'", "speeds");
  refused("{device: 'pty:', speeds: []}", "one signal, or four");
  refused("{device: 'pty:', speeds: [{frame: '1', length: 65}]}", "length");
  WheelDriverConfig wrong = mapping();
  wrong.speeds[0].frame = "0xZZ";
  CHECK_THROWS_WITH(WheelDriver(wrong), Catch::Contains("0xZZ"));
}

}  // namespace
}  // namespace roadfix
