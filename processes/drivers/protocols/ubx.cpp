#include "drivers/protocols/ubx.h"

#include <array>
#include <cmath>

#include "drivers/protocols/bytes.h"
#include "drivers/protocols/checksums.h"
#include "drivers/protocols/utc.h"
#include "geometry/frames.h"

namespace roadfix {

namespace {

constexpr uint8_t kSync1 = 0xB5, kSync2 = 0x62;
constexpr std::size_t kHeaderBytes = 6, kChecksumBytes = 2;
/// Raw measurements of all bands (RXM-RAWX, 16 + 32 x 90) are the longest that a receiver is asked for.
constexpr std::size_t kMaxPayload = 4096;
constexpr std::size_t kPvtBytes = 92, kRelPosV0Bytes = 40, kRelPosV1Bytes = 64, kEoeBytes = 4;
constexpr double kMetresPerCm = 1e-2, kMetresPerTenthMm = 1e-4;

bool bit(uint32_t flags, unsigned index) { return ((flags >> index) & 1U) != 0; }

/// Flags of NAV-RELPOSNED, the same bits in both versions.
void read_flags(uint32_t flags, UbxNavRelPosNed& r) {
  r.valid = bit(flags, 2);
  r.carrier_solution = static_cast<uint8_t>((flags >> 3U) & 3U);
  r.moving_base = bit(flags, 5);
}

double metres(std::span<const uint8_t> p, std::size_t centimetres, std::size_t tenth_mm) {
  return little_endian<int32_t>(p, centimetres) * kMetresPerCm + little_endian<int8_t>(p, tenth_mm) * kMetresPerTenthMm;
}

/// Version 0 has no heading: that of the vector, with the accuracies across it.
void heading_of_vector(std::span<const uint8_t> p, UbxNavRelPosNed& r) {
  r.length_m = std::sqrt(r.north_m * r.north_m + r.east_m * r.east_m + r.down_m * r.down_m);
  const double horizontal = std::hypot(r.north_m, r.east_m);
  r.heading_deg = std::atan2(r.east_m, r.north_m) / kDegree;
  if (r.heading_deg < 0.0) r.heading_deg += 360.0;
  const double north_accuracy = little_endian<uint32_t>(p, 24) * kMetresPerTenthMm;
  const double east_accuracy = little_endian<uint32_t>(p, 28) * kMetresPerTenthMm;
  r.heading_valid = r.valid && horizontal > 0.0;
  if (r.heading_valid) r.heading_accuracy_deg = std::hypot(north_accuracy, east_accuracy) / horizontal / kDegree;
}

}  // namespace

Probe probe_ubx(std::span<const uint8_t> bytes) {
  if (bytes[0] != kSync1 || (bytes.size() > 1 && bytes[1] != kSync2)) return {};
  if (bytes.size() < kHeaderBytes) return {Fit::kIncomplete, 0};
  const std::size_t payload = little_endian<uint16_t>(bytes, 4);
  if (payload > kMaxPayload) return {};
  const std::size_t size = kHeaderBytes + payload + kChecksumBytes;
  if (bytes.size() < size) return {Fit::kIncomplete, 0};
  const uint16_t computed = ubx_checksum(bytes.subspan(2, kHeaderBytes - 2 + payload));
  if (computed != little_endian<uint16_t>(bytes, kHeaderBytes + payload)) return {Fit::kBadChecksum, 0};
  return {Fit::kFrame, size};
}

UbxFrame ubx_frame(std::span<const uint8_t> frame) {
  return {frame[2], frame[3], frame.subspan(kHeaderBytes, frame.size() - kHeaderBytes - kChecksumBytes)};
}

std::optional<UbxNavPvt> parse_nav_pvt(std::span<const uint8_t> p) {
  if (p.size() != kPvtBytes) return std::nullopt;
  UbxNavPvt m;
  m.time_of_week_ms = little_endian<uint32_t>(p, 0);
  const uint8_t valid = p[11];
  if (bit(valid, 0) && bit(valid, 1)) {
    const auto whole = utc_us(little_endian<uint16_t>(p, 4), p[6], p[7], p[8], p[9], p[10]);
    if (whole) m.utc_us = *whole + std::lround(little_endian<int32_t>(p, 16) * 1e-3);
  }
  m.fix_type = p[20];
  m.fix_ok = bit(p[21], 0);
  m.differential = bit(p[21], 1);
  m.carrier_solution = static_cast<uint8_t>(p[21] >> 6U);
  m.num_satellites = p[23];
  m.lon_1e7_deg = little_endian<int32_t>(p, 24);
  m.lat_1e7_deg = little_endian<int32_t>(p, 28);
  m.height_mm = little_endian<int32_t>(p, 32);
  m.horizontal_accuracy_mm = little_endian<uint32_t>(p, 40);
  m.vertical_accuracy_mm = little_endian<uint32_t>(p, 44);
  for (std::size_t i = 0; i < 3; ++i) m.velocity_ned_mmps[i] = little_endian<int32_t>(p, 48 + 4 * i);
  m.speed_accuracy_mmps = little_endian<uint32_t>(p, 68);
  m.pdop_1e2 = little_endian<uint16_t>(p, 76);
  m.position_invalid = bit(p[78], 0);
  m.correction_age_class = static_cast<uint8_t>((p[78] >> 1U) & 15U);
  return m;
}

std::optional<double> ubx_correction_age_s(uint8_t correction_age_class) {
  constexpr std::array<double, 12> kUpTo_s = {0, 1, 2, 5, 10, 15, 20, 30, 45, 60, 90, 120};
  constexpr double kOlder_s = 1000.0;
  if (correction_age_class == 0) return std::nullopt;
  return correction_age_class < kUpTo_s.size() ? kUpTo_s[correction_age_class] : kOlder_s;
}

std::optional<UbxNavRelPosNed> parse_nav_relposned(std::span<const uint8_t> p) {
  const bool v0 = p.size() == kRelPosV0Bytes && p[0] == 0;
  const bool v1 = p.size() == kRelPosV1Bytes && p[0] == 1;
  if (!v0 && !v1) return std::nullopt;
  UbxNavRelPosNed r;
  r.time_of_week_ms = little_endian<uint32_t>(p, 4);
  const std::size_t fine = v0 ? 20 : 32;  // where the tenths of a millimetre stand
  r.north_m = metres(p, 8, fine);
  r.east_m = metres(p, 12, fine + 1);
  r.down_m = metres(p, 16, fine + 2);
  if (v0) {
    read_flags(little_endian<uint32_t>(p, 36), r);
    heading_of_vector(p, r);
    return r;
  }
  const auto flags = little_endian<uint32_t>(p, 60);
  read_flags(flags, r);
  r.length_m = metres(p, 20, 35);
  r.heading_deg = little_endian<int32_t>(p, 24) * 1e-5;
  r.heading_accuracy_deg = little_endian<uint32_t>(p, 52) * 1e-5;
  r.heading_valid = bit(flags, 8);
  return r;
}

std::optional<uint32_t> parse_nav_eoe(std::span<const uint8_t> payload) {
  if (payload.size() != kEoeBytes) return std::nullopt;
  return little_endian<uint32_t>(payload, 0);
}

}  // namespace roadfix
