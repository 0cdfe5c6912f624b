#include "drivers/protocols/sbg.h"

#include "drivers/protocols/bytes.h"
#include "drivers/protocols/checksums.h"

namespace roadfix {

namespace {

constexpr uint8_t kSync1 = 0xFF, kSync2 = 0x5A, kEnd = 0x33;
constexpr std::size_t kHeaderBytes = 6, kTailBytes = 3;
constexpr std::size_t kMaxPayload = 4086;
constexpr uint8_t kLargeFrameFlag = 0x80;  // of the class byte

constexpr std::size_t kImuShortBytes = 32, kEkfNavBytes = 72, kEkfQuatBytes = 36, kGpsPosBytes = 57, kGpsVelBytes = 44,
                      kGpsHdtBytes = 26;

constexpr double kAccelLsb = 1048576.0;                                  // per m/s2
constexpr double kGyroLsb = 67108864.0, kGyroHighRangeLsb = 12304174.0;  // per rad/s
constexpr double kTemperatureLsb = 256.0;                                // per deg C
constexpr double kSecondsPerAgeLsb = 0.01;

bool bit(uint32_t flags, unsigned index) { return ((flags >> index) & 1U) != 0; }

void floats(std::span<const uint8_t> p, std::size_t offset, std::span<double> to) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] = static_cast<double>(little_endian<float>(p, offset + 4 * i));
}

SbgSolution solution(uint32_t status) {
  return {static_cast<uint8_t>(status & 15U), bit(status, 4), bit(status, 5), bit(status, 6), bit(status, 7)};
}

/// Bits 0..5 "computed", bits 6..11 the type.
SbgPositionType position_type(uint32_t status) {
  constexpr uint32_t kMask = 63;
  if ((status & kMask) != 0) return SbgPositionType::kNone;
  switch ((status >> 6U) & kMask) {
    case 0:
      return SbgPositionType::kNone;
    case 2:
      return SbgPositionType::kSingle;
    case 3:  // differential
    case 4:  // with a satellite's corrections
    case 5:  // Omnistar VBS
      return SbgPositionType::kDifferential;
    case 6:  // RTK
    case 8:  // precise point positioning
      return SbgPositionType::kRtkFloat;
    case 7:
    case 9:
    case 10:  // a fixed location
      return SbgPositionType::kRtkFixed;
    default:
      return SbgPositionType::kUnknown;
  }
}

}  // namespace

Probe probe_sbg(std::span<const uint8_t> bytes) {
  if (bytes[0] != kSync1 || (bytes.size() > 1 && bytes[1] != kSync2)) return {};
  if (bytes.size() < kHeaderBytes) return {Fit::kIncomplete, 0};
  const std::size_t payload = little_endian<uint16_t>(bytes, 4);
  if (payload > kMaxPayload) return {};
  const std::size_t size = kHeaderBytes + payload + kTailBytes;
  if (bytes.size() < size) return {Fit::kIncomplete, 0};
  if (bytes[size - 1] != kEnd) return {};
  const uint16_t computed = crc16_sbg(bytes.subspan(2, kHeaderBytes - 2 + payload));
  if (computed != little_endian<uint16_t>(bytes, kHeaderBytes + payload)) return {Fit::kBadChecksum, 0};
  return {Fit::kFrame, size};
}

SbgFrame sbg_frame(std::span<const uint8_t> frame) {
  const std::span<const uint8_t> payload = frame.subspan(kHeaderBytes, frame.size() - kHeaderBytes - kTailBytes);
  if ((frame[3] & kLargeFrameFlag) != 0) return {frame[3], frame[2], {}};
  return {frame[3], frame[2], payload};
}

std::optional<SbgImuShort> parse_sbg_imu_short(std::span<const uint8_t> p) {
  constexpr unsigned kFirstTest = 0, kLastTest = 7, kAccelsInRange = 8, kGyrosInRange = 9, kHighScale = 10;
  if (p.size() < kImuShortBytes) return std::nullopt;
  SbgImuShort m;
  m.time_us = little_endian<uint32_t>(p, 0);
  const auto status = little_endian<uint16_t>(p, 4);
  m.healthy = true;
  for (unsigned i = kFirstTest; i <= kLastTest; ++i) m.healthy = m.healthy && bit(status, i);
  m.in_range = bit(status, kAccelsInRange) && bit(status, kGyrosInRange);
  const double gyro_lsb = bit(status, kHighScale) ? kGyroHighRangeLsb : kGyroLsb;
  for (std::size_t i = 0; i < 3; ++i) {
    m.accel_mps2[i] = little_endian<int32_t>(p, 6 + 4 * i) / kAccelLsb;
    m.gyro_radps[i] = little_endian<int32_t>(p, 18 + 4 * i) / gyro_lsb;
  }
  m.temperature_c = little_endian<int16_t>(p, 30) / kTemperatureLsb;
  return m;
}

std::optional<SbgEkfNav> parse_sbg_ekf_nav(std::span<const uint8_t> p) {
  if (p.size() < kEkfNavBytes) return std::nullopt;
  SbgEkfNav m;
  m.time_us = little_endian<uint32_t>(p, 0);
  floats(p, 4, m.velocity_ned_mps);
  floats(p, 16, m.velocity_std_ned_mps);
  m.lat_deg = little_endian<double>(p, 28);
  m.lon_deg = little_endian<double>(p, 36);
  m.height_msl_m = little_endian<double>(p, 44);
  m.undulation_m = static_cast<double>(little_endian<float>(p, 52));
  floats(p, 56, m.position_std_ned_m);
  m.solution = solution(little_endian<uint32_t>(p, 68));
  return m;
}

std::optional<SbgEkfQuat> parse_sbg_ekf_quat(std::span<const uint8_t> p) {
  if (p.size() < kEkfQuatBytes) return std::nullopt;
  SbgEkfQuat m;
  m.time_us = little_endian<uint32_t>(p, 0);
  floats(p, 4, m.q_ned_body_wxyz);
  floats(p, 20, m.roll_pitch_yaw_std_rad);
  m.solution = solution(little_endian<uint32_t>(p, 32));
  return m;
}

std::optional<SbgGpsPos> parse_sbg_gps_pos(std::span<const uint8_t> p) {
  constexpr uint8_t kNoCount = 0xFF;
  constexpr uint16_t kNoAge = 0xFFFF;
  if (p.size() < kGpsPosBytes) return std::nullopt;
  SbgGpsPos m;
  m.time_us = little_endian<uint32_t>(p, 0);
  m.type = position_type(little_endian<uint32_t>(p, 4));
  m.time_of_week_ms = little_endian<uint32_t>(p, 8);
  m.lat_deg = little_endian<double>(p, 12);
  m.lon_deg = little_endian<double>(p, 20);
  m.height_msl_m = little_endian<double>(p, 28);
  m.undulation_m = static_cast<double>(little_endian<float>(p, 36));
  m.std_north_m = static_cast<double>(little_endian<float>(p, 40));
  m.std_east_m = static_cast<double>(little_endian<float>(p, 44));
  m.std_up_m = static_cast<double>(little_endian<float>(p, 48));
  if (p[52] != kNoCount) m.num_satellites = p[52];
  const auto age = little_endian<uint16_t>(p, 55);
  if (age != kNoAge) m.correction_age_s = age * kSecondsPerAgeLsb;
  return m;
}

std::optional<SbgGpsVel> parse_sbg_gps_vel(std::span<const uint8_t> p) {
  constexpr uint32_t kStatus = 63, kTypeShift = 6;
  if (p.size() < kGpsVelBytes) return std::nullopt;
  SbgGpsVel m;
  m.time_us = little_endian<uint32_t>(p, 0);
  const auto status = little_endian<uint32_t>(p, 4);
  m.computed = (status & kStatus) == 0 && ((status >> kTypeShift) & kStatus) != 0;
  m.time_of_week_ms = little_endian<uint32_t>(p, 8);
  floats(p, 12, m.velocity_ned_mps);
  floats(p, 24, m.std_ned_mps);
  return m;
}

std::optional<SbgGpsHdt> parse_sbg_gps_hdt(std::span<const uint8_t> p) {
  constexpr uint16_t kStatus = 63;
  if (p.size() < kGpsHdtBytes) return std::nullopt;
  SbgGpsHdt m;
  m.time_us = little_endian<uint32_t>(p, 0);
  m.computed = (little_endian<uint16_t>(p, 4) & kStatus) == 0;
  m.time_of_week_ms = little_endian<uint32_t>(p, 6);
  m.heading_deg = static_cast<double>(little_endian<float>(p, 10));
  m.heading_std_deg = static_cast<double>(little_endian<float>(p, 14));
  m.pitch_deg = static_cast<double>(little_endian<float>(p, 18));
  return m;
}

}  // namespace roadfix
