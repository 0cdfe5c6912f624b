// Drivers in the car: killed with SIGKILL and started again by `roadfix run`, fed with garbage and with nothing,
// unplugged and plugged in. They are back within 2 s (printed; the test allows 5 times that), and every byte that a
// device sent is on the raw channel or in a gap that has a reason, and of each run in a frame or counted as skipped.
// Started by driver_recovery.sh, in a network namespace, with the programs' folder in ROADFIX_BIN.
#include <fmt/format.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <iostream>

#include "bus/log/log_reader.h"
#include "bus/log/log_writer.h"
#include "drivers/device/run_driver.h"
#include "drivers/gnss_driver/handler.h"
#include "drivers/imu_driver/handler.h"
#include "recovery_rig.h"
#include "support/receiver_bytes.h"
#include "support/sbg_logs.h"

namespace roadfix {
namespace {

using test::Bytes;
using test::RecoveryRig;
using Says = RecoveryRig::Says;

constexpr double kWanted_s = 2.0, kAllowed = 5.0;

void say(const std::string& what, double seconds) {
  std::cout << fmt::format("{}: back after {:.2f} s (wanted {:.0f})\n", what, seconds, kWanted_s);
  CHECK(seconds < kAllowed * kWanted_s);
}

/// The device's bytes as they came out: one stretch for each opening of the device.
std::vector<Bytes> stretches(const std::vector<raw_t>& raw) {
  std::vector<Bytes> result;
  int64_t run = 0, next_seq = 0;
  for (const raw_t& message : raw) {
    if (message.run != run) next_seq = 0;
    REQUIRE(message.seq == next_seq);  // nothing was lost on the bus
    next_seq = message.seq + 1;
    if (message.run != run || message.data.empty()) result.emplace_back();
    run = message.run;
    test::append(result.back(), message.data);
  }
  return result;
}

/// Each stretch stands in what was sent, behind the one before, and what lies between them is expected to be missing.
bool is_accounted_for(const std::vector<Bytes>& found, const Bytes& sent, const std::vector<test::ExpectedGap>& gaps) {
  std::size_t end = 0;
  for (const Bytes& stretch : found) {
    if (stretch.empty()) continue;
    const auto at =
        std::search(sent.begin() + static_cast<std::ptrdiff_t>(end), sent.end(), stretch.begin(), stretch.end());
    if (at == sent.end()) {
      UNSCOPED_INFO("a stretch of " << stretch.size() << " bytes was not sent behind byte " << end);
      return false;
    }
    const auto begin = static_cast<std::size_t>(at - sent.begin());
    const bool expected = begin == end || std::any_of(gaps.begin(), gaps.end(), [&](const test::ExpectedGap& gap) {
                            return end >= gap.from && begin <= gap.to;
                          });
    if (!expected) UNSCOPED_INFO("bytes " << end << " to " << begin << " are missing");
    if (!expected) return false;
    end = begin + stretch.size();
  }
  if (end != sent.size()) UNSCOPED_INFO("bytes " << end << " to " << sent.size() << ", the last, are missing");
  return end == sent.size();
}

bool ends_with_the_last_byte(RecoveryRig& rig) {
  const std::vector<raw_t> raw = rig.raw();
  const Bytes& sent = rig.device().sent();
  const std::vector<uint8_t>& last = raw.back().data;
  return last.size() <= sent.size() && std::equal(last.rbegin(), last.rend(), sent.rbegin());
}

/// The last run's heartbeat: whole frames and skipped bytes are all bytes of that run.
bool is_every_byte_counted(const RecoveryRig& rig, const test::DriverUnderTest& driver) {
  const heartbeat_t h = rig.heartbeat();
  std::size_t bytes = 0;
  for (const raw_t& message : rig.raw())
    if (message.run == h.run) bytes += message.data.size();
  int64_t frames = 0, skipped = 0;
  for (std::size_t i = 0; i < h.input_channel.size(); ++i) {
    if (h.input_channel[i] == driver.protocol) frames = h.input_received[i];
    skipped += h.input_skipped[i];
  }
  return frames > 0 && frames * static_cast<int64_t>(driver.frame_bytes) + skipped == static_cast<int64_t>(bytes);
}

/// The sensor messages that the raw ones give.
std::vector<Bytes> replayed(RecoveryRig& rig, const std::vector<Bytes>& raw, const std::string& channel,
                            const DriverSetup& setup) {
  {
    LogWriter log(rig.folder() / "raw.lcm");
    for (const Bytes& bytes : raw) log.write(channel, read_header(bytes)->utime, bytes);
    log.commit();
  }
  CHECK(replay_driver(rig.folder() / "raw.lcm", rig.folder() / "again.lcm", setup).lost == 0);
  LogReader reader(rig.folder() / "again.lcm");
  std::vector<Bytes> again;
  while (const auto event = reader.next()) again.emplace_back(event->data.begin(), event->data.end());
  return again;
}

/// Behind the last message of the first run, the one that was killed.
std::vector<Bytes>::iterator end_of_first_run(std::vector<Bytes>& messages) {
  const int64_t run = read_header(messages.front())->run;
  return std::find_if(messages.begin(), messages.end(), [&](const Bytes& b) { return read_header(b)->run != run; });
}

/// The raw messages give the sensor messages again, byte for byte. The killed driver may have died between its last raw
/// message and what it makes of it: of that one, the last sensor messages may be missing.
void replay_agrees(RecoveryRig& rig, const test::DriverUnderTest& driver, const DriverSetup& setup) {
  std::vector<Bytes> raw = rig.on(driver.raw_channel), live = rig.on(driver.channel);
  std::vector<Bytes> again = replayed(rig, raw, driver.raw_channel, setup);
  raw.erase(end_of_first_run(raw) - 1);
  const std::size_t least = replayed(rig, raw, driver.raw_channel, setup).size();
  REQUIRE(live.size() <= again.size());
  REQUIRE(live.size() >= least);
  const auto died = end_of_first_run(again);
  again.erase(died - static_cast<std::ptrdiff_t>(again.size() - live.size()), died);
  CHECK(again == live);
  live.erase(live.begin() + static_cast<std::ptrdiff_t>(live.size() / 2));  // teeth: one in the middle is missing
  again.erase(end_of_first_run(again) - 1);
  CHECK_FALSE(again == live);
}

void put_through_it(const test::DriverUnderTest& driver, const DriverSetup& setup) {
  const char* const programs = std::getenv("ROADFIX_BIN");
  REQUIRE(programs != nullptr);
  RecoveryRig rig(programs, driver, "silence_s: 0.5\n");
  // It flushes the port when it opens it, and says so with an empty raw message: before that nothing is sent.
  const bool opened = rig.run_until(Says::kNothing, 60.0, [&] { return !rig.on(driver.raw_channel).empty(); });
  INFO("roadfix run said: " << rig.said());
  REQUIRE(opened);
  say(driver.name + " started", rig.recovery_s());
  rig.run_for(Says::kFrames, 0.5);

  rig.kill_driver();
  say(driver.name + " killed and up again", rig.recovery_s());
  rig.run_for(Says::kFrames, 0.3);

  rig.run_for(Says::kGarbage, 0.7);
  say(driver.name + " after garbage", rig.recovery_s());
  const auto told = [&] { return rig.heartbeat().state_reason.find("no byte for") != std::string::npos; };
  CHECK(rig.run_until(Says::kNothing, 60.0, told));
  say(driver.name + " after silence", rig.recovery_s());
  rig.unplug_for(0.5);
  say(driver.name + " plugged in again", rig.recovery_s());

  rig.run_for(Says::kFrames, 0.3);
  // On a busy machine the last bytes and the heartbeat that counts them may take their time.
  rig.run_until(Says::kNothing, 60.0,
                [&] { return ends_with_the_last_byte(rig) && is_every_byte_counted(rig, driver); });
  const std::vector<raw_t> raw = rig.raw();
  const std::vector<Bytes> found = stretches(raw);
  CHECK(found.size() == 3);  // started, killed, unplugged
  CHECK(is_accounted_for(found, rig.device().sent(), rig.gaps()));
  for (const std::size_t i : {0U, 1U, 2U}) {  // teeth: one byte is missing, one is wrong
    std::vector<Bytes> less = found, wrong = found;
    less.at(i).erase(less[i].begin() + static_cast<std::ptrdiff_t>(less[i].size() / 2));
    wrong.at(i)[wrong[i].size() / 2] ^= 1U;
    CHECK_FALSE(is_accounted_for(less, rig.device().sent(), rig.gaps()));
    CHECK_FALSE(is_accounted_for(wrong, rig.device().sent(), rig.gaps()));
  }
  CHECK_FALSE(is_accounted_for(found, rig.device().sent(), {}));
  CHECK(is_every_byte_counted(rig, driver));
  test::DriverUnderTest other = driver;  // teeth: frames of another length would not add up
  ++other.frame_bytes;
  CHECK_FALSE(is_every_byte_counted(rig, other));
  replay_agrees(rig, driver, setup);
  CHECK(rig.said().find(driver.name + ": opened " + (rig.folder() / "device").string()) != std::string::npos);
}

TEST_CASE("imu_driver: killed, garbage, silence, unplugged") {
  test::DriverUnderTest driver;
  driver.name = "imu_driver";
  driver.channel = "IMU";
  driver.raw_channel = "RAW_IMU";
  driver.protocol = "sbgECom";
  driver.frame_bytes = 41;
  driver.period_s = 0.005;
  driver.frame = [](double t_s) { return test::sbg_imu_bytes(static_cast<uint32_t>(t_s * 1e6)); };
  put_through_it(driver, imu_driver_setup(ImuDriverConfig{}));
}

TEST_CASE("gnss_driver: killed, garbage, silence, unplugged") {
  test::DriverUnderTest driver;
  driver.name = "gnss_driver";
  driver.channel = "GNSS";
  driver.raw_channel = "RAW_GNSS";
  driver.protocol = "UBX";
  driver.frame_bytes = 100;
  driver.period_s = 0.1;
  driver.frame = [](double t_s) {
    const auto t_us = static_cast<int64_t>(t_s * 1e6);
    return test::pvt_bytes(*utc_us(2024, 5, 3, 12, 0, 0) + t_us, static_cast<uint32_t>(t_us / 1000), 48.0);
  };
  put_through_it(driver, gnss_driver_setup(GnssDriverConfig{}));
}

}  // namespace
}  // namespace roadfix
