#include "drivers/protocols/framer.h"

#include <catch2/catch.hpp>
#include <random>

#include "drivers/protocols/nmea.h"
#include "drivers/protocols/rtcm.h"
#include "drivers/protocols/sbg.h"
#include "drivers/protocols/ubx.h"
#include "support/device_bytes.h"

namespace roadfix {
namespace {

using test::append;
using test::Bytes;

Framer four_protocols() { return Framer({probe_ubx, probe_nmea, probe_rtcm, probe_sbg}); }

std::vector<Bytes> some_frames() {
  return {test::ubx_bytes(1, 7, Bytes(92, 0x11)),   test::nmea_bytes("GPGGA,092750.000,,,,,0,,,,M,,M,,"),
          test::rtcm_bytes({0x3E, 0xD0, 0x01}),     test::sbg_bytes(44, Bytes(32, 0x5A)),
          test::ubx_bytes(1, 0x61, Bytes(4, 0xFF)), test::ubx_bytes(5, 1, {})};
}

void take_all(Framer& framer, std::vector<Bytes>& frames) {
  while (const auto frame = framer.next()) frames.emplace_back(frame->bytes.begin(), frame->bytes.end());
}

/// All frames that come out when the stream is handed over in pieces.
std::vector<Bytes> frames_of(Framer& framer, const Bytes& stream, const std::vector<std::size_t>& cuts) {
  std::vector<Bytes> frames;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= cuts.size(); ++i) {
    const std::size_t end = i < cuts.size() ? cuts[i] : stream.size();
    framer.feed(0, {stream.data() + begin, end - begin});
    take_all(framer, frames);
    begin = end;
  }
  return frames;
}

Bytes joined(const std::vector<Bytes>& frames) {
  Bytes stream;
  for (const Bytes& frame : frames) append(stream, frame);
  return stream;
}

TEST_CASE("a stream cut at every byte gives the same frames") {
  const std::vector<Bytes> frames = some_frames();
  const Bytes stream = joined(frames);
  for (std::size_t cut = 0; cut <= stream.size(); ++cut) {
    Framer framer = four_protocols();
    REQUIRE(frames_of(framer, stream, {cut}) == frames);
    REQUIRE(framer.skipped_bytes() == 0);
  }
  std::vector<std::size_t> every_byte;
  for (std::size_t i = 1; i < stream.size(); ++i) every_byte.push_back(i);
  Framer framer = four_protocols();
  CHECK(frames_of(framer, stream, every_byte) == frames);
}

TEST_CASE("noise between the frames costs none of them, and each of its bytes is counted") {
  std::mt19937 random(7);
  for (int round = 0; round < 200; ++round) {
    const std::vector<Bytes> frames = some_frames();
    Bytes stream;
    std::size_t noise_bytes = 0;
    for (const Bytes& frame : frames) {
      // Seldom enough beginnings of frames that the longest of them, 4 kB, is over before the stream is.
      Bytes noise(random() % 40);
      for (uint8_t& byte : noise) byte = static_cast<uint8_t>(random());
      noise_bytes += noise.size();
      append(stream, noise);
      append(stream, frame);
    }
    const Bytes padding(5000, 0);
    append(stream, padding);
    Framer framer = four_protocols();
    REQUIRE(frames_of(framer, stream, {stream.size() / 3, stream.size() / 2}) == frames);
    REQUIRE(framer.skipped_bytes() == static_cast<int64_t>(noise_bytes + padding.size()));
  }
}

TEST_CASE("one wrong byte costs its own frame only, and is counted as a wrong checksum") {
  const std::vector<Bytes> frames = some_frames();
  const std::size_t first = frames[0].size();
  for (std::size_t at = 6; at < first; ++at) {  // behind the header: a wrong length is another matter
    Bytes stream = joined(frames);
    stream[at] ^= 0x40U;
    Framer framer = four_protocols();
    const std::vector<Bytes> found = frames_of(framer, stream, {at});
    REQUIRE(found == std::vector<Bytes>(frames.begin() + 1, frames.end()));
    REQUIRE(framer.bad_checksums(0) == 1);
    REQUIRE(framer.skipped_bytes() == static_cast<int64_t>(first));
  }
}

TEST_CASE("a frame that was cut short does not swallow the next one") {
  const std::vector<Bytes> frames = some_frames();
  for (const Bytes& frame : frames) {
    for (std::size_t kept = 1; kept < frame.size(); ++kept) {
      Bytes stream(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(kept));
      append(stream, joined(frames));
      append(stream, Bytes(5000, 0));  // a false length is found out when its bytes are there
      Framer framer = four_protocols();
      REQUIRE(frames_of(framer, stream, {}) == frames);
    }
  }
}

TEST_CASE("a beginning that never ends is given up after its patience") {
  const Bytes frame = test::ubx_bytes(1, 7, Bytes(92, 1));
  const Bytes false_start = {0xB5, 0x62, 0x01, 0x07, 0xFF, 0x0F};  // says that 4095 bytes follow
  Framer framer({probe_ubx});
  framer.feed(1'000'000, false_start);
  CHECK_FALSE(framer.next());
  framer.feed(1'200'000, frame);
  CHECK_FALSE(framer.next());  // 0.2 s: it may still come
  framer.feed(1'400'000, frame);
  int found = 0;
  while (framer.next()) ++found;
  CHECK(found == 2);
  CHECK(framer.skipped_bytes() == static_cast<int64_t>(false_start.size()));
}

TEST_CASE("a new start of the device throws the half frame away") {
  const Bytes frame = test::sbg_bytes(44, Bytes(32, 7));
  Framer framer({probe_sbg});
  framer.feed(0, {frame.data(), 10});
  CHECK_FALSE(framer.next());
  framer.reset();
  CHECK(framer.skipped_bytes() == 10);
  framer.feed(0, frame);
  CHECK(framer.next());
  CHECK(framer.waiting_bytes() == 0);
}

}  // namespace
}  // namespace roadfix
