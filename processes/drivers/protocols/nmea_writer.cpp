#include "drivers/protocols/nmea_writer.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "drivers/protocols/checksums.h"

namespace roadfix {

namespace {

constexpr double kKnotsPerMps = 3600.0 / 1852.0;
constexpr double kKmphPerMps = 3.6;
constexpr int64_t kMinuteUnits = 1'000'000;  ///< written digits of a minute: 1.9 mm; more make GGA longer than 82
constexpr int kMaxSatellites = 99;           ///< two digits
constexpr double kLargest = 99'999.0;        ///< what has more digits than a sentence has room for is not known

/// Rounded to milliseconds, the digits written.
struct Utc {
  std::chrono::year_month_day date;
  int64_t hours, minutes, seconds, milliseconds;
};

Utc utc_of(int64_t t_us) {
  using std::chrono::milliseconds;
  const auto t = std::chrono::round<milliseconds>(
      std::chrono::sys_time<std::chrono::microseconds>(std::chrono::microseconds(t_us)));
  const auto day = std::chrono::floor<std::chrono::days>(t);
  const int64_t ms = (t - day).count();
  return {std::chrono::year_month_day(day), ms / 3'600'000, ms / 60'000 % 60, ms / 1000 % 60, ms % 1000};
}

std::string time_field(int64_t t_us) {
  const Utc t = utc_of(t_us);
  return fmt::format("{:02}{:02}{:02}.{:03}", t.hours, t.minutes, t.seconds, t.milliseconds);
}

/// Empty where absent, not a number, or larger than any that makes sense.
std::string number(const std::optional<double>& value, int decimals) {
  if (!value || !std::isfinite(*value) || std::abs(*value) > kLargest) return {};
  return fmt::format("{:.{}f}", *value, decimals);
}

/// [0, 360), also after rounding to the digits written.
std::string direction(const std::optional<double>& degrees) {
  if (!degrees || !std::isfinite(*degrees)) return {};
  constexpr int64_t kUnits = 1000, kTurn = 360 * kUnits;
  const int64_t units = (std::llround(*degrees * kUnits) % kTurn + kTurn) % kTurn;
  return fmt::format("{}.{:03}", units / kUnits, units % kUnits);
}

/// ddmm.mmmmmm,N: rounded as a whole, so that no minute is 60.
std::string angle(double degrees, int degree_digits, char positive, char negative) {
  const int64_t units = std::llround(std::abs(degrees) * 60.0 * kMinuteUnits);
  const int64_t minutes = units / kMinuteUnits;
  return fmt::format("{:0{}}{:02}.{:06},{}", minutes / 60, degree_digits, minutes % 60, units % kMinuteUnits,
                     degrees < 0.0 ? negative : positive);
}

bool is_place(const std::optional<NmeaPosition>& p) {
  return p && std::abs(p->lat_deg) <= 90.0 && std::abs(p->lon_deg) <= 180.0;  // false for what is no number
}

bool has_position(const NmeaPose& pose) { return pose.quality != NmeaQuality::kNone && is_place(pose.position); }

std::string position_fields(const NmeaPose& pose) {
  if (!has_position(pose)) return ",,,";
  return angle(pose.position->lat_deg, 2, 'N', 'S') + "," + angle(pose.position->lon_deg, 3, 'E', 'W');
}

/// A position that cannot be written is none, whatever the quality.
NmeaQuality quality(const NmeaPose& pose) { return has_position(pose) ? pose.quality : NmeaQuality::kNone; }

char mode(const NmeaPose& pose) {
  switch (quality(pose)) {
    case NmeaQuality::kNone:
      return 'N';
    case NmeaQuality::kSingle:
      return 'A';
    case NmeaQuality::kDifferential:
      return 'D';
    case NmeaQuality::kRtkFixed:
      return 'R';
    case NmeaQuality::kRtkFloat:
      return 'F';
    case NmeaQuality::kDeadReckoning:
      return 'E';
  }
  return 'N';
}

/// What only a pose with a position has.
template <class T>
std::optional<T> with_position(const NmeaPose& pose, const std::optional<T>& value) {
  return has_position(pose) ? value : std::nullopt;
}

std::string sentence(const std::string& talker, const std::string& rest) {
  const std::string body = talker + rest;
  const uint8_t sum = nmea_checksum({reinterpret_cast<const uint8_t*>(body.data()), body.size()});
  return fmt::format("${}*{:02X}\r\n", body, sum);
}

}  // namespace

std::string write_gga(const NmeaPose& pose, const std::string& talker) {
  const auto satellites = with_position(pose, pose.num_satellites);
  const std::string count =
      satellites && *satellites >= 0 ? fmt::format("{:02}", std::min(*satellites, kMaxSatellites)) : "";
  // Units stand also where the number is unknown, as receivers write it.
  return sentence(talker,
                  fmt::format("GGA,{},{},{},{},,{},M,{},M,{},", time_field(pose.t_us), position_fields(pose),
                              static_cast<int>(quality(pose)), count, number(with_position(pose, pose.height_msl_m), 2),
                              number(with_position(pose, pose.geoid_separation_m), 2),
                              number(with_position(pose, pose.correction_age_s), 0)));
}

std::string write_rmc(const NmeaPose& pose, const std::string& talker) {
  const auto speed = with_position(pose, pose.speed_mps);
  const Utc t = utc_of(pose.t_us);
  return sentence(
      talker,
      fmt::format("RMC,{},{},{},{},{},{:02}{:02}{:02},,,{},V", time_field(pose.t_us), has_position(pose) ? 'A' : 'V',
                  position_fields(pose), number(speed ? std::optional(*speed * kKnotsPerMps) : speed, 3),
                  direction(with_position(pose, pose.course_deg)), static_cast<unsigned>(t.date.day()),
                  static_cast<unsigned>(t.date.month()), static_cast<int>(t.date.year()) % 100, mode(pose)));
}

std::string write_vtg(const NmeaPose& pose, const std::string& talker) {
  const auto speed = with_position(pose, pose.speed_mps);
  return sentence(talker, fmt::format("VTG,{},T,,M,{},N,{},K,{}", direction(with_position(pose, pose.course_deg)),
                                      number(speed ? std::optional(*speed * kKnotsPerMps) : speed, 3),
                                      number(speed ? std::optional(*speed * kKmphPerMps) : speed, 3), mode(pose)));
}

std::string write_hdt(const NmeaPose& pose, const std::string& talker) {
  return sentence(talker, "HDT," + direction(pose.heading_deg) + ",T");
}

std::string write_gst(const NmeaPose& pose, const std::string& talker) {
  const auto d = with_position(pose, pose.deviations);
  const auto field = [&](double NmeaDeviations::*member) {
    return number(d ? std::optional((*d).*member) : std::nullopt, 3);
  };
  const auto orientation = d ? std::optional(d->orientation_deg) : std::nullopt;
  return sentence(talker,
                  fmt::format("GST,{},,{},{},{},{},{},{}", time_field(pose.t_us), field(&NmeaDeviations::major_m),
                              field(&NmeaDeviations::minor_m), direction(orientation), field(&NmeaDeviations::lat_m),
                              field(&NmeaDeviations::lon_m), field(&NmeaDeviations::height_m)));
}

std::string write_zda(const NmeaPose& pose, const std::string& talker) {
  const Utc t = utc_of(pose.t_us);
  return sentence(
      talker, fmt::format("ZDA,{},{:02},{:02},{:04},00,00", time_field(pose.t_us), static_cast<unsigned>(t.date.day()),
                          static_cast<unsigned>(t.date.month()), static_cast<int>(t.date.year())));
}

}  // namespace roadfix
