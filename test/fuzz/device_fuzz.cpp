// Whatever bytes a device sends, and in whatever pieces they are read: its driver lives, keeps no more than one frame,
// accounts for every byte, publishes only what its messages promise (device_promises.h), and the pieces change nothing.
//
// ROADFIX_FUZZ_DEVICE chooses the protocol. The first byte of the input: bit 0, make the checksums right first; bit 1,
// of GNSS: take the receiver's UTC for utime; the others choose the pieces. Of CAN, what stands before a zero byte is
// the mapping's YAML.
#include <algorithm>

#include "config/config.h"
#include "drivers/gnss_driver/handler.h"
#include "drivers/imu_driver/handler.h"
#include "drivers/protocols/ntrip.h"
#include "drivers/protocols/rtcm.h"
#include "drivers/wheel_driver/handler.h"
#include "fuzz/device_promises.h"
#include "fuzz/device_seal.h"

namespace roadfix {
namespace {

using test::promise;
using test::PromisedOutputs;
using test::SealKind;
using Bytes = std::vector<uint8_t>;
using MakeDriver = std::function<std::unique_ptr<SensorDriver>()>;

enum Device { kUbx, kNmea, kSbg, kCan, kCorrections };
constexpr Device kDevice = ROADFIX_FUZZ_DEVICE;

constexpr SealKind kSeal[] = {SealKind::kUbx, SealKind::kNmea, SealKind::kSbg, SealKind::kNone, SealKind::kRtcm};
constexpr ProbeFrame kProbe[] = {probe_ubx, probe_nmea, probe_sbg, probe_can_line, probe_rtcm};
constexpr std::size_t kLongestFrame = 4200;
constexpr int64_t kStart = 1'700'000'000'000'000;
constexpr int64_t kMaxClockError_us = 500'000;

/// How one stream is read.
struct Reading {
  uint32_t seed = 0;     ///< of the pieces; 0: all at once
  bool timed = false;    ///< time passes between the reads, and the device is opened again now and then
  int64_t ahead_us = 0;  ///< by which a stamp may be later than its reading
};

/// Calls read(utime, piece, opened anew) with the stream's pieces: of one byte and of thousands.
template <class Read>
void in_pieces(std::span<const uint8_t> stream, const Reading& reading, const Read& read) {
  constexpr int64_t kPauses_us[] = {0, 0, 1'000, 10'000, 200'000, 400'000, 3'000'000, 3'600'000'000};
  uint32_t random = reading.seed;
  const auto next = [&random] { return (random = random * 1664525U + 1013904223U) >> 8U; };
  int64_t utime = kStart;
  for (std::size_t at = 0; at < stream.size();) {
    const std::size_t wish = reading.seed == 0 ? stream.size() : 1 + next() % (1U << (next() % 11U));
    const std::size_t size = std::min(wish, stream.size() - at);
    if (reading.timed) utime += kPauses_us[next() % std::size(kPauses_us)];
    read(utime, stream.subspan(at, size), at == 0 || (reading.timed && next() % 64U == 0));
    at += size;
  }
}

void account_for_every_byte(std::span<const uint8_t> stream, const Reading& reading) {
  Framer framer({kProbe[kDevice]});
  std::size_t framed = 0;
  in_pieces(stream, reading, [&](int64_t utime, std::span<const uint8_t> piece, bool anew) {
    if (anew) framer.reset();
    framer.feed(utime, piece);
    while (const auto frame = framer.next()) framed += frame->bytes.size();
    promise(framer.waiting_bytes() <= kLongestFrame, "no more than one frame is kept");
  });
  promise(framed + static_cast<std::size_t>(framer.skipped_bytes()) + framer.waiting_bytes() == stream.size(),
          "every byte is in a frame, skipped or waiting");
}

struct Outcome {
  std::map<std::string, std::vector<Bytes>> sent;
  std::vector<StreamCounters> counters;
  std::string for_the_caster;
  bool operator==(const Outcome&) const = default;
};

Outcome drive(const MakeDriver& make, std::span<const uint8_t> stream, const Reading& reading) {
  const std::unique_ptr<SensorDriver> driver = make();
  PromisedOutputs outputs;
  outputs.begin(1);
  in_pieces(stream, reading, [&](int64_t utime, std::span<const uint8_t> piece, bool anew) {
    if (anew) driver->opened(0);
    outputs.read_at(utime, reading.ahead_us);
    driver->take(0, utime, piece, outputs);
  });
  Outcome outcome{outputs.sent(), driver->counters(), {}};
  if (const auto* gnss = dynamic_cast<const GnssDriver*>(driver.get())) {
    outcome.for_the_caster = gnss->position_for_caster(kStart).value_or("");
  }
  if (!outcome.for_the_caster.empty()) {
    const Bytes text(outcome.for_the_caster.begin(), outcome.for_the_caster.end());
    promise(probe_nmea(text).size == text.size() && parse_gga(nmea_sentence(text)), "the caster gets a GGA sentence");
  }
  return outcome;
}

void try_driver(const MakeDriver& make, std::span<const uint8_t> stream, uint32_t seed, int64_t ahead_us) {
  promise(drive(make, stream, {0, false, ahead_us}) == drive(make, stream, {seed, false, ahead_us}),
          "the pieces in which a stream is read change nothing");
  static_cast<void>(drive(make, stream, {seed, true, ahead_us}));
}

struct Corrections {
  Bytes bytes;
  NtripAnswer::State state = NtripAnswer::State::kWaiting;
  std::string why;
  bool operator==(const Corrections&) const = default;
};

Corrections corrections(std::span<const uint8_t> stream, const Reading& reading) {
  NtripAnswer answer;
  Corrections result;
  in_pieces(stream, reading, [&](int64_t utime, std::span<const uint8_t> piece, bool) {
    for (const uint8_t byte : answer.feed(utime, piece)) result.bytes.push_back(byte);
    promise(answer.waiting_bytes() <= NtripAnswer::kMaxHead + kLongestFrame, "no more than a head and a frame is kept");
  });
  result.state = answer.state();
  result.why = answer.why();
  Framer framer({probe_rtcm});
  framer.feed(0, result.bytes);
  while (framer.next()) {
  }
  promise(framer.skipped_bytes() == 0 && framer.waiting_bytes() == 0, "the receiver gets whole frames alone");
  return result;
}

std::unique_ptr<SensorDriver> make_gnss(bool utc) {
  GnssDriverConfig config;
  config.moving_base = true;
  config.time = utc ? GnssTime::kUtc : GnssTime::kMapped;
  config.max_clock_error = static_cast<double>(kMaxClockError_us) * 1e-6;
  return std::make_unique<GnssDriver>(config);
}

std::unique_ptr<SensorDriver> make_imu() {
  ImuDriverConfig config;
  config.gnss_channel = "GNSS";
  config.solution_channel = "REFERENCE";
  return std::make_unique<ImuDriver>(config);
}

/// The mapping that the input brings, or one with all kinds of signals.
std::optional<WheelDriverConfig> mapping(std::span<const uint8_t>& stream) {
  const auto zero = std::find(stream.begin(), stream.end(), uint8_t{0});
  std::string text =
      "{device: 'pty:', speeds: [{frame: '123', start_bit: 3, length: 13}], direction: {frame: '18FEF100'}, "
      "yaw_rate: {frame: '123', start_bit: 23, length: 16, byte_order: big, signed: true}}";
  if (zero != stream.end()) {
    text.assign(stream.begin(), zero);
    stream = stream.subspan(text.size() + 1);
  }
  try {
    auto config = parse_config<WheelDriverConfig>(text, "fuzz");
    const std::string written = config_text(config);
    promise(config_text(parse_config<WheelDriverConfig>(written, "written")) == written,
            "a mapping is written as it is read");
    static_cast<void>(wheel_driver_setup(config));
    config.channel = "WHEELS";
    return config;
  } catch (const ConfigError&) {
  } catch (const std::invalid_argument&) {  // of an identifier that is none
  }
  return std::nullopt;
}

}  // namespace
}  // namespace roadfix

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  using namespace roadfix;
  if (size == 0) return 0;
  std::vector<uint8_t> bytes(data + 1, data + size);
  if ((data[0] & 1U) != 0) test::seal(kSeal[kDevice], bytes);
  const bool utc = (data[0] & 2U) != 0;
  const uint32_t seed = 1 + data[0] / 4U;
  std::span<const uint8_t> stream = bytes;
  switch (kDevice) {
    case kUbx:
    case kNmea:
      try_driver([&] { return make_gnss(utc); }, stream, seed, utc ? kMaxClockError_us : 0);
      break;
    case kSbg:
      try_driver(make_imu, stream, seed, 0);
      break;
    case kCan:
      if (const auto config = mapping(stream)) {
        try_driver([&] { return std::make_unique<WheelDriver>(*config); }, stream, seed, 0);
      }
      break;
    case kCorrections:
      promise(corrections(stream, {0, false, 0}) == corrections(stream, {seed, false, 0}),
              "the pieces in which corrections come change nothing");
      static_cast<void>(corrections(stream, {seed, true, 0}));
      break;
  }
  account_for_every_byte(stream, {seed, false, 0});
  account_for_every_byte(stream, {seed, true, 0});
  return 0;
}
