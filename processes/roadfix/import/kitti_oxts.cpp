#include "roadfix/import/kitti_oxts.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <string_view>

#include "config/config_error.h"
#include "config/scalar.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "roadfix/import/text_table.h"

namespace roadfix {
namespace {

struct Field {
  const char* name;
  double min;
  double max;
};

constexpr double kAngle = 3.1416;  // rad, pi as it is rounded up in files
constexpr double kSpeed = 150.0;   // m/s
constexpr double kAccel = 1000.0;  // m/s2
constexpr double kRate = 100.0;    // rad/s
constexpr double kSigma = 1e5;     // m or m/s
constexpr double kMode = 1000.0;

/// In the order of dataformat.txt.
constexpr std::array<Field, 30> kFields = {
    {{"lat", -90.0, 90.0},          {"lon", -180.0, 180.0},     {"alt", -1000.0, 20000.0},
     {"roll", -kAngle, kAngle},     {"pitch", -kAngle, kAngle}, {"yaw", -2.0 * kAngle, 2.0 * kAngle},
     {"vn", -kSpeed, kSpeed},       {"ve", -kSpeed, kSpeed},    {"vf", -kSpeed, kSpeed},
     {"vl", -kSpeed, kSpeed},       {"vu", -kSpeed, kSpeed},    {"ax", -kAccel, kAccel},
     {"ay", -kAccel, kAccel},       {"az", -kAccel, kAccel},    {"af", -kAccel, kAccel},
     {"al", -kAccel, kAccel},       {"au", -kAccel, kAccel},    {"wx", -kRate, kRate},
     {"wy", -kRate, kRate},         {"wz", -kRate, kRate},      {"wf", -kRate, kRate},
     {"wl", -kRate, kRate},         {"wu", -kRate, kRate},      {"pos_accuracy", 0.0, kSigma},
     {"vel_accuracy", 0.0, kSigma}, {"navstat", -kMode, kMode}, {"numsats", -1.0, kMode},
     {"posmode", -1.0, kMode},      {"velmode", -1.0, kMode},   {"orimode", -1.0, kMode}}};

/// Position modes of the RT's primary receiver (OxTS, NCOM data format, GPS position modes). While the receiver has none, the
/// unit's own dead reckoning carries the solution.
FixType fix_type_of(int position_mode) {
  switch (position_mode) {
    case 3:
      return FixType::kSingle;
    case 4:  // differential
    case 7:  // WAAS
    case 8:  // OmniSTAR VBS
    case 9:  // OmniSTAR HP
      return FixType::kDifferential;
    case 5:
      return FixType::kRtkFloat;
    case 6:
      return FixType::kRtkFixed;
    default:
      return FixType::kDeadReckoning;
  }
}

/// The digits at `at`, as many as `count`; -1 where they are none.
int64_t digits(std::string_view text, std::size_t at, std::size_t count) {
  int64_t value = 0;
  for (std::size_t i = at; i < at + count; ++i) {
    if (i >= text.size() || text[i] < '0' || text[i] > '9') return -1;
    value = 10 * value + (text[i] - '0');
  }
  return value;
}

/// Microseconds of "YYYY-MM-DD hh:mm:ss.nnnnnnnnn"; nothing where it is none. A fraction that is shorter was cut.
std::optional<int64_t> parse_time(std::string_view text) {
  constexpr std::string_view kShape = "0000-00-00 00:00:00.000000000";
  if (text.size() != kShape.size()) return std::nullopt;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (kShape[i] != '0' && text[i] != kShape[i]) return std::nullopt;
    if (kShape[i] == '0' && digits(text, i, 1) < 0) return std::nullopt;
  }
  const std::chrono::year_month_day day(std::chrono::year(static_cast<int>(digits(text, 0, 4))),
                                        std::chrono::month(static_cast<unsigned>(digits(text, 5, 2))),
                                        std::chrono::day(static_cast<unsigned>(digits(text, 8, 2))));
  const int64_t hour = digits(text, 11, 2);
  const int64_t minute = digits(text, 14, 2);
  const int64_t second = digits(text, 17, 2);
  if (!day.ok() || day.year() < std::chrono::year(1970) || hour > 23 || minute > 59 || second > 59) {
    return std::nullopt;
  }
  const int64_t days = std::chrono::sys_days(day).time_since_epoch().count();
  return (((days * 24 + hour) * 60 + minute) * 60 + second) * 1'000'000 + digits(text, 20, 6);
}

}  // namespace

OxtsPacket parse_oxts(const std::string& text, const std::string& file) {
  const std::vector<TextRow> rows = parse_text_table(text, file);
  if (rows.size() != 1) throw ConfigError(file, rows[1].line, "a packet is one line");
  const std::vector<double>& n = rows.front().numbers;
  if (n.size() != kFields.size()) {
    throw ConfigError(file, rows.front().line,
                      fmt::format("has {} numbers, a packet has {}", n.size(), kFields.size()));
  }
  for (std::size_t i = 0; i < n.size(); ++i) {
    if (n[i] >= kFields[i].min && n[i] <= kFields[i].max) continue;
    throw ConfigError(file, rows.front().line,
                      fmt::format("{} (number {}) = {}: must be within {} to {}", kFields[i].name, i + 1, to_text(n[i]),
                                  kFields[i].min, kFields[i].max));
  }
  OxtsPacket packet;
  const double longitude = n[1] * kDegree;
  packet.position = {n[0] * kDegree, longitude >= kPi ? longitude - 2.0 * kPi : longitude, n[2]};
  packet.q_enu_imu = quaternion({n[5], n[4], n[3]});
  packet.velocity_enu = {n[7], n[6], n[10]};
  packet.accel = {n[11], n[12], n[13]};
  packet.gyro = {n[17], n[18], n[19]};
  packet.position_accuracy = n[23];
  packet.velocity_accuracy = n[24];
  packet.num_satellites = std::max(0, static_cast<int>(n[26]));
  packet.fix_type = fix_type_of(static_cast<int>(n[27]));
  return packet;
}

std::vector<int64_t> parse_kitti_times(const std::string& text, const std::string& file) {
  std::vector<int64_t> times_us;
  int line_number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string_view line = std::string_view(text).substr(at, end - at);
    at = end + 1;
    ++line_number;
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty() && at >= text.size()) break;
    const auto t_us = parse_time(line);
    if (!t_us) {
      std::string shown(line.substr(0, 40));
      for (char& c : shown) c = c >= ' ' && c < 0x7f ? c : '?';
      throw ConfigError(file, line_number,
                        fmt::format("'{}': must be a time like 2011-09-26 13:02:25.964389445", shown));
    }
    times_us.push_back(*t_us);
  }
  if (times_us.empty()) throw ConfigError(file, 0, "holds no times");
  return times_us;
}

}  // namespace roadfix
