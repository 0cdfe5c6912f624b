#include "drivers/protocols/nmea.h"

#include <charconv>
#include <cmath>

#include "drivers/protocols/checksums.h"

namespace roadfix {

namespace {

/// 82 by the standard; receivers exceed it with many digits and in sentences of their own.
constexpr std::size_t kMaxSentence = 256;
constexpr double kMpsPerKnot = 1852.0 / 3600.0;
constexpr double kMpsPerKmph = 1.0 / 3.6;
constexpr double kMinutesPerDegree = 60.0;

int hex_digit(uint8_t c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

bool digits(std::string_view text) {
  for (const char c : text)
    if (c < '0' || c > '9') return false;
  return !text.empty();
}

/// A plain decimal number; neither "inf" nor an exponent stands in a sentence.
std::optional<double> number(std::string_view field) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value, std::chars_format::fixed);
  if (error != std::errc() || end != field.data() + field.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<int> whole(std::string_view field) {
  int value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || end != field.data() + field.size()) return std::nullopt;
  return value;
}

std::string_view field(const NmeaSentence& s, std::size_t i) {
  return i < s.fields.size() ? s.fields[i] : std::string_view();
}

/// ddmm.mmmm or dddmm.mmmm and its hemisphere.
std::optional<double> angle_deg(std::string_view text, std::string_view hemisphere, std::size_t degree_digits,
                                char positive, char negative, double limit_deg) {
  if (text.size() < degree_digits + 2 || !digits(text.substr(0, degree_digits + 2))) return std::nullopt;
  const auto degrees = number(text.substr(0, degree_digits));
  const auto minutes = number(text.substr(degree_digits));
  if (!degrees || !minutes || *minutes >= kMinutesPerDegree || hemisphere.size() != 1) return std::nullopt;
  const double value = *degrees + *minutes / kMinutesPerDegree;
  if (value > limit_deg || (hemisphere[0] != positive && hemisphere[0] != negative)) return std::nullopt;
  return hemisphere[0] == negative ? -value : value;
}

std::optional<NmeaPosition> position(const NmeaSentence& s, std::size_t first) {
  const auto lat = angle_deg(field(s, first), field(s, first + 1), 2, 'N', 'S', 90.0);
  const auto lon = angle_deg(field(s, first + 2), field(s, first + 3), 3, 'E', 'W', 180.0);
  if (!lat || !lon) return std::nullopt;
  return NmeaPosition{*lat, *lon};
}

std::optional<double> course(std::string_view text) {
  const auto value = number(text);
  return value && *value >= 0.0 && *value <= 360.0 ? value : std::nullopt;
}

std::optional<double> not_negative(std::string_view text) {
  const auto value = number(text);
  return value && *value >= 0.0 ? value : std::nullopt;
}

/// Two digits and the end of the line; some devices send a line feed alone.
Probe behind_star(std::span<const uint8_t> bytes, std::size_t star) {
  std::size_t end = star + 3;
  for (std::size_t i = star + 1; i < end && i < bytes.size(); ++i)
    if (hex_digit(bytes[i]) < 0) return {};
  if (end < bytes.size() && bytes[end] == '\r') ++end;
  if (end >= bytes.size()) return {Fit::kIncomplete, 0};
  if (bytes[end] != '\n') return {};
  const int sum = hex_digit(bytes[star + 1]) * 16 + hex_digit(bytes[star + 2]);
  if (sum != nmea_checksum(bytes.subspan(1, star - 1))) return {Fit::kBadChecksum, 0};
  return {Fit::kFrame, end + 1};
}

}  // namespace

Probe probe_nmea(std::span<const uint8_t> bytes) {
  if (bytes[0] != '$') return {};
  for (std::size_t i = 1; i < bytes.size(); ++i) {
    if (i > kMaxSentence) return {};
    if (bytes[i] == '*') return behind_star(bytes, i);
    if (bytes[i] < ' ' || bytes[i] > '~' || bytes[i] == '$') return {};  // cut short, or never was a sentence
  }
  return {Fit::kIncomplete, 0};
}

NmeaSentence nmea_sentence(std::span<const uint8_t> frame) {
  std::string_view text(reinterpret_cast<const char*>(frame.data()), frame.size());
  text = text.substr(1, text.rfind('*') - 1);
  NmeaSentence sentence;
  const std::size_t comma = text.find(',');
  const std::string_view address = text.substr(0, comma);
  const bool proprietary = address.starts_with('P');
  sentence.talker = proprietary || address.size() < 3 ? std::string_view() : address.substr(0, address.size() - 3);
  sentence.type = proprietary || address.size() < 3 ? address : address.substr(address.size() - 3);
  for (std::size_t begin = comma; begin != std::string_view::npos;) {
    const std::size_t end = text.find(',', begin + 1);
    sentence.fields.push_back(
        text.substr(begin + 1, end == std::string_view::npos ? std::string_view::npos : end - begin - 1));
    begin = end;
  }
  return sentence;
}

std::optional<int64_t> nmea_time_of_day_us(std::string_view text) {
  constexpr std::size_t kWholeDigits = 6;
  if (text.size() < kWholeDigits || !digits(text.substr(0, kWholeDigits))) return std::nullopt;
  const auto hours = whole(text.substr(0, 2)), minutes = whole(text.substr(2, 2)), seconds = whole(text.substr(4, 2));
  if (*hours > 23 || *minutes > 59 || *seconds > 60) return std::nullopt;
  int64_t t_us = (int64_t{*hours} * 3600 + int64_t{*minutes} * 60 + *seconds) * 1'000'000;
  if (text.size() == kWholeDigits) return t_us;
  const auto fraction = number(text.substr(kWholeDigits));
  if (text[kWholeDigits] != '.' || !fraction) return std::nullopt;
  return t_us + std::llround(*fraction * 1e6);
}

std::optional<NmeaGga> parse_gga(const NmeaSentence& s) {
  if (s.type != "GGA") return std::nullopt;
  const auto time = nmea_time_of_day_us(field(s, 0));
  const auto quality = whole(field(s, 5));
  if (!time || !quality || *quality < 0 || *quality > 8) return std::nullopt;
  NmeaGga m;
  m.time_of_day_us = *time;
  m.quality = *quality;
  m.position = position(s, 1);
  if (m.quality != 0 && !m.position) return std::nullopt;
  if (const auto n = whole(field(s, 6)); n && *n >= 0 && *n < 1000) m.num_satellites = n;
  m.hdop = not_negative(field(s, 7));
  m.height_msl_m = number(field(s, 8));
  m.geoid_separation_m = number(field(s, 10));
  m.correction_age_s = not_negative(field(s, 12));
  return m;
}

std::optional<NmeaMotion> parse_rmc(const NmeaSentence& s) {
  if (s.type != "RMC") return std::nullopt;
  NmeaMotion m;
  m.time_of_day_us = nmea_time_of_day_us(field(s, 0));
  if (!m.time_of_day_us) return std::nullopt;
  m.valid = field(s, 1) == "A";
  if (const auto knots = not_negative(field(s, 6))) m.speed_mps = *knots * kMpsPerKnot;
  m.course_deg = course(field(s, 7));
  return m;
}

std::optional<NmeaMotion> parse_vtg(const NmeaSentence& s) {
  if (s.type != "VTG") return std::nullopt;
  NmeaMotion m;
  m.course_deg = course(field(s, 0));
  if (const auto kmph = not_negative(field(s, 6))) m.speed_mps = *kmph * kMpsPerKmph;
  m.valid = m.speed_mps.has_value() && field(s, 8) != "N";
  return m;
}

std::optional<NmeaGst> parse_gst(const NmeaSentence& s) {
  if (s.type != "GST") return std::nullopt;
  const auto time = nmea_time_of_day_us(field(s, 0));
  const auto north = not_negative(field(s, 5)), east = not_negative(field(s, 6)), up = not_negative(field(s, 7));
  if (!time || !north || !east || !up || *north == 0.0 || *east == 0.0 || *up == 0.0) return std::nullopt;
  return NmeaGst{*time, *north, *east, *up};
}

std::optional<double> parse_gsa_pdop(const NmeaSentence& s) {
  constexpr std::size_t kPdopField = 14;
  return s.type == "GSA" ? not_negative(field(s, kPdopField)) : std::nullopt;
}

std::optional<double> parse_heading_deg(const NmeaSentence& s) {
  const bool measured = s.type == "HDT" || (s.type == "THS" && field(s, 1) == "A");
  return measured ? course(field(s, 0)) : std::nullopt;
}

}  // namespace roadfix
