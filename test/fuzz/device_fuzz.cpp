// Whatever bytes a device sends, its driver lives, every byte is in a frame, skipped or waiting, and every message that
// goes out passes the schema's check. ROADFIX_FUZZ_DEVICE chooses the protocol; the first byte of the input says in
// which pieces the rest is read.
#include <cmath>
#include <cstdlib>

#include "bus/schema.h"
#include "config/config.h"
#include "drivers/gnss_driver/handler.h"
#include "drivers/imu_driver/handler.h"
#include "drivers/protocols/ntrip.h"
#include "drivers/protocols/rtcm.h"
#include "drivers/wheel_driver/handler.h"

namespace roadfix {
namespace {

enum Device { kUbx, kNmea, kSbg, kCan, kCorrections };
constexpr Device kDevice = ROADFIX_FUZZ_DEVICE;

class CheckedOutputs : public SensorOutputs {
 protected:
  void send(const std::string& channel, int64_t, std::span<const uint8_t> bytes) override {
    static const MessageCheck kGnss = Schema::built_in().check_of("gnss_t"),
                              kImu = Schema::built_in().check_of("imu_t"),
                              kWheels = Schema::built_in().check_of("wheels_t"),
                              kPose = Schema::built_in().check_of("pose_t");
    const MessageCheck& check = channel == "GNSS"     ? kGnss
                                : channel == "IMU"    ? kImu
                                : channel == "WHEELS" ? kWheels
                                                      : kPose;
    if (check(bytes) != CheckResult::kOk) std::abort();
  }
};

std::unique_ptr<SensorDriver> make_driver() {
  if constexpr (kDevice == kSbg) {
    ImuDriverConfig config;
    config.gnss_channel = "GNSS";
    config.solution_channel = "REFERENCE";
    return std::make_unique<ImuDriver>(config);
  } else if constexpr (kDevice == kCan) {
    return std::make_unique<WheelDriver>(parse_config<WheelDriverConfig>(
        "{device: 'pty:', speeds: [{frame: '123', start_bit: 3, length: 13}], direction: {frame: '18FEF100'}, "
        "yaw_rate: {frame: '123', start_bit: 23, length: 16, byte_order: big, signed: true}}",
        "fuzz"));
  } else {
    GnssDriverConfig config;
    config.moving_base = true;
    return std::make_unique<GnssDriver>(config);
  }
}

ProbeFrame probe() {
  switch (kDevice) {
    case kUbx:
      return probe_ubx;
    case kNmea:
      return probe_nmea;
    case kSbg:
      return probe_sbg;
    case kCan:
      return probe_can_line;
    case kCorrections:
      break;
  }
  return probe_rtcm;
}

/// Calls with the pieces of the input.
template <class Read>
void in_pieces(std::span<const uint8_t> bytes, std::size_t piece, const Read& read) {
  int64_t t_us = 1'700'000'000'000'000;
  for (std::size_t at = 0; at < bytes.size(); at += piece, t_us += 10'000) {
    read(t_us, bytes.subspan(at, std::min(piece, bytes.size() - at)));
  }
}

void account_for_every_byte(std::span<const uint8_t> bytes, std::size_t piece) {
  Framer framer({probe()});
  std::size_t framed = 0;
  in_pieces(bytes, piece, [&](int64_t t_us, std::span<const uint8_t> part) {
    framer.feed(t_us, part);
    while (const auto frame = framer.next()) framed += frame->bytes.size();
  });
  if (framed + static_cast<std::size_t>(framer.skipped_bytes()) + framer.waiting_bytes() != bytes.size()) std::abort();
}

}  // namespace
}  // namespace roadfix

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const uint8_t> bytes(data + 1, size - 1);
  const std::size_t piece = 1 + data[0];
  using namespace roadfix;
  account_for_every_byte(bytes, piece);
  if constexpr (kDevice == kCorrections) {
    NtripAnswer answer;
    in_pieces(bytes, piece,
              [&](int64_t t_us, std::span<const uint8_t> part) { static_cast<void>(answer.feed(t_us, part)); });
  } else {
    const std::unique_ptr<SensorDriver> driver = make_driver();
    CheckedOutputs outputs;
    outputs.begin(1);
    driver->opened(0);
    in_pieces(bytes, piece, [&](int64_t t_us, std::span<const uint8_t> part) { driver->take(0, t_us, part, outputs); });
    static_cast<void>(driver->counters());
  }
  return 0;
}
