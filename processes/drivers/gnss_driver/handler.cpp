#include "drivers/gnss_driver/handler.h"

#include <fmt/format.h>

#include <cmath>

#include "bus/sample_codec.h"
#include "config/config.h"
#include "drivers/protocols/checksums.h"
#include "drivers/protocols/rtcm.h"
#include "drivers/protocols/utc.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

namespace {

constexpr double kMetresPerMm = 1e-3;
constexpr double kDegreesPerLsb = 1e-7;
/// NMEA counts again when no NAV-PVT has come for so long.
constexpr int64_t kUbxSilence_us = 5'000'000;
/// A direction that nothing measures: NMEA has no vertical velocity.
constexpr double kUnknownVelocity_mps = 100.0;
/// Below this a receiver leaves the course out.
constexpr double kStanding_mps = 0.5;

double square(double x) { return x * x; }

Eigen::Matrix3d diagonal(double east_std, double north_std, double up_std) {
  return Eigen::Vector3d(square(east_std), square(north_std), square(up_std)).asDiagonal();
}

FixType ubx_fix_type(const UbxNavPvt& m) {
  constexpr uint8_t kDeadReckoning = 1, k2d = 2, k3d = 3, kCombined = 4;
  if (!m.fix_ok || m.position_invalid) return FixType::kNone;
  if (m.fix_type == kDeadReckoning) return FixType::kDeadReckoning;
  if (m.fix_type != k2d && m.fix_type != k3d && m.fix_type != kCombined) return FixType::kNone;
  if (m.carrier_solution == 2) return FixType::kRtkFixed;
  if (m.carrier_solution == 1) return FixType::kRtkFloat;
  return m.differential ? FixType::kDifferential : FixType::kSingle;
}

FixType nmea_fix_type(int quality) {
  switch (quality) {
    case 1:
    case 3:  // precise positioning service
      return FixType::kSingle;
    case 2:
      return FixType::kDifferential;
    case 4:
      return FixType::kRtkFixed;
    case 5:
      return FixType::kRtkFloat;
    case 6:
      return FixType::kDeadReckoning;
    default:  // none, typed in by hand, simulated
      return FixType::kNone;
  }
}

double sigma_of(FixType type, const NmeaSigmas& sigmas) {
  switch (type) {
    case FixType::kRtkFixed:
      return sigmas.rtk_fixed;
    case FixType::kRtkFloat:
      return sigmas.rtk_float;
    case FixType::kDifferential:
      return sigmas.differential;
    default:
      return sigmas.single;
  }
}

}  // namespace

GnssDriver::GnssDriver(const GnssDriverConfig& config)
    : config_(config), framer_({probe_ubx, probe_nmea, probe_rtcm}) {}

void GnssDriver::opened(int) {
  framer_.reset();
  epochs_.reset();
  clock_.restart();
}

void GnssDriver::take(int, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) {
  framer_.feed(read_utime, bytes);
  epochs_.wait(read_utime);
  while (const std::optional<Frame> frame = framer_.next()) {
    if (frame->protocol == kUbx) take_ubx(frame->bytes, read_utime);
    if (frame->protocol == kNmea) take_nmea(frame->bytes, read_utime);
  }
  publish(outputs);
}

std::optional<int64_t> GnssDriver::utime_of(int64_t utc, int64_t read_utime) {
  if (config_.time == GnssTime::kUtc) {
    const bool near = std::abs(static_cast<double>(utc - read_utime)) <= config_.max_clock_error * 1e6;
    return near ? std::optional<int64_t>(utc) : std::nullopt;
  }
  const auto latency_us = std::llround(config_.latency * 1e6);
  const std::optional<int64_t> utime = clock_.utime(utc, read_utime);
  return utime ? std::optional<int64_t>(*utime - latency_us) : std::nullopt;
}

void GnssDriver::take_ubx(std::span<const uint8_t> bytes, int64_t read_utime) {
  const UbxFrame frame = ubx_frame(bytes);
  if (frame.is(kUbxNav, kUbxNavPvt)) {
    const auto pvt = parse_nav_pvt(frame.payload);
    if (pvt)
      take_pvt(*pvt, read_utime);
    else
      ++ubx_.refused;
  } else if (frame.is(kUbxNav, kUbxNavRelPosNed) && config_.moving_base) {
    const auto relative = parse_nav_relposned(frame.payload);
    if (relative)
      take_relposned(*relative, read_utime);
    else
      ++ubx_.refused;
  } else if (frame.is(kUbxNav, kUbxNavEoe)) {
    if (const auto key = parse_nav_eoe(frame.payload)) epochs_.end(*key);
  }
}

void GnssDriver::take_pvt(const UbxNavPvt& m, int64_t read_utime) {
  ubx_seen_us_ = read_utime;
  const std::optional<int64_t> utime = m.utc_us ? utime_of(*m.utc_us, read_utime) : std::nullopt;
  GnssFix* fix = utime ? epochs_.part(m.time_of_week_ms, GnssEpochs::kPosition, read_utime) : nullptr;
  if (fix == nullptr) {
    ++ubx_.refused;
    return;
  }
  ++ubx_.used;
  fix->t_us = *utime;
  fix->fix_type = ubx_fix_type(m);
  fix->height_kind = HeightKind::kEllipsoid;
  fix->antenna = {m.lat_1e7_deg * kDegreesPerLsb * kDegree, wrap_angle(m.lon_1e7_deg * kDegreesPerLsb * kDegree),
                  m.height_mm * kMetresPerMm};
  const double horizontal = m.horizontal_accuracy_mm * kMetresPerMm;
  fix->cov_enu = diagonal(horizontal, horizontal, m.vertical_accuracy_mm * kMetresPerMm);
  GnssVelocity velocity;  // north, east, down to east, north, up
  const Eigen::Vector3d ned(m.velocity_ned_mmps[0], m.velocity_ned_mmps[1], m.velocity_ned_mmps[2]);
  velocity.enu = kMetresPerMm * Eigen::Vector3d(ned.y(), ned.x(), -ned.z());
  const double speed_std = m.speed_accuracy_mmps * kMetresPerMm;
  velocity.cov_enu = diagonal(speed_std, speed_std, speed_std);
  fix->velocity = velocity;
  fix->num_satellites = m.num_satellites;
  fix->pdop = m.pdop_1e2 * 0.01;
  fix->correction_age = ubx_correction_age_s(m.correction_age_class);
  epochs_.mark(GnssEpochs::kPosition);
}

void GnssDriver::take_relposned(const UbxNavRelPosNed& r, int64_t read_utime) {
  GnssFix* fix = epochs_.part(r.time_of_week_ms, GnssEpochs::kHeading, read_utime);
  if (fix == nullptr) {
    ++ubx_.refused;
    return;
  }
  ++ubx_.used;
  if (r.valid && r.heading_valid) set_heading(r.heading_deg, r.heading_accuracy_deg, *fix);
  epochs_.mark(GnssEpochs::kHeading);
}

void GnssDriver::set_heading(double heading_deg, double std_deg, GnssFix& fix) const {
  double heading = std::fmod(heading_deg - config_.baseline_heading_deg, 360.0);
  if (heading < 0.0) heading += 360.0;
  fix.heading = GnssHeading{heading * kDegree, std_deg * kDegree};
}

void GnssDriver::take_nmea(std::span<const uint8_t> frame, int64_t read_utime) {
  if (ubx_seen_us_ && read_utime - *ubx_seen_us_ < kUbxSilence_us) return;
  const NmeaSentence sentence = nmea_sentence(frame);
  const bool ours = sentence.type == "GGA" || sentence.type == "RMC" || sentence.type == "GST";
  if (const auto gga = parse_gga(sentence)) {
    take_gga(*gga, read_utime);
  } else if (const auto rmc = parse_rmc(sentence)) {
    take_motion(*rmc, read_utime);
  } else if (const auto vtg = parse_vtg(sentence)) {
    take_motion(*vtg, read_utime);
  } else if (const auto gst = parse_gst(sentence)) {
    take_gst(*gst, read_utime);
  } else if (const auto heading = parse_heading_deg(sentence)) {
    take_heading(*heading, read_utime);
  } else if (const auto pdop = parse_gsa_pdop(sentence)) {
    pdop_ = pdop;
  } else if (ours) {
    ++nmea_.refused;
  }
}

void GnssDriver::take_gga(const NmeaGga& gga, int64_t read_utime) {
  const std::optional<int64_t> utime = utime_of(nearest_day(gga.time_of_day_us, read_utime), read_utime);
  GnssFix* fix = utime ? epochs_.part(gga.time_of_day_us, GnssEpochs::kPosition, read_utime) : nullptr;
  if (fix == nullptr) {
    ++nmea_.refused;
    return;
  }
  ++nmea_.used;
  fix->t_us = *utime;
  fix->fix_type = nmea_fix_type(gga.quality);
  fix->height_kind = HeightKind::kUnknown;
  if (gga.position) {
    fix->antenna.latitude = gga.position->lat_deg * kDegree;
    fix->antenna.longitude = wrap_angle(gga.position->lon_deg * kDegree);
  }
  if (gga.height_msl_m) {
    fix->antenna.height = *gga.height_msl_m + gga.geoid_separation_m.value_or(0.0);
    fix->height_kind = gga.geoid_separation_m ? HeightKind::kEllipsoid : HeightKind::kMeanSeaLevel;
  }
  const double dop = gga.hdop && *gga.hdop > 0.0 ? *gga.hdop : 1.0;  // some say 0 where they know none
  const double horizontal = sigma_of(fix->fix_type, config_.nmea) * dop;
  if (!epochs_.has(GnssEpochs::kAccuracy)) {
    fix->cov_enu = diagonal(horizontal, horizontal, config_.nmea.vertical_ratio * horizontal);
  }
  fix->num_satellites = gga.num_satellites;
  fix->correction_age = gga.correction_age_s;
  fix->pdop = pdop_;
  epochs_.mark(GnssEpochs::kPosition);
}

void GnssDriver::take_motion(const NmeaMotion& motion, int64_t read_utime) {
  const int64_t key = motion.time_of_day_us.value_or(epochs_.key());
  if (key < 0 || (!motion.time_of_day_us && epochs_.has(GnssEpochs::kVelocity))) return;
  GnssFix* fix = epochs_.part(key, GnssEpochs::kVelocity, read_utime);
  if (fix == nullptr) return;
  const bool directed = motion.course_deg || (motion.speed_mps && *motion.speed_mps < kStanding_mps);
  if (motion.valid && motion.speed_mps && directed) {
    const double course = motion.course_deg.value_or(0.0) * kDegree;
    GnssVelocity velocity;
    velocity.enu = *motion.speed_mps * Eigen::Vector3d(std::sin(course), std::cos(course), 0.0);
    velocity.cov_enu = diagonal(config_.nmea.velocity, config_.nmea.velocity, kUnknownVelocity_mps);
    fix->velocity = velocity;
    ++nmea_.used;
  }
  epochs_.mark(GnssEpochs::kVelocity);
}

void GnssDriver::take_gst(const NmeaGst& gst, int64_t read_utime) {
  GnssFix* fix = epochs_.part(gst.time_of_day_us, GnssEpochs::kAccuracy, read_utime);
  if (fix == nullptr) return;
  ++nmea_.used;
  fix->cov_enu = diagonal(gst.east_std_m, gst.north_std_m, gst.up_std_m);
  epochs_.mark(GnssEpochs::kAccuracy);
}

void GnssDriver::take_heading(double heading_deg, int64_t read_utime) {
  if (epochs_.key() < 0) return;
  GnssFix* fix = epochs_.part(epochs_.key(), GnssEpochs::kHeading, read_utime);
  if (fix == nullptr) return;
  ++nmea_.used;
  set_heading(heading_deg, config_.heading_std_deg, *fix);
  epochs_.mark(GnssEpochs::kHeading);
}

void GnssDriver::publish(SensorOutputs& outputs) {
  for (const GnssFix& fix : epochs_.take()) {
    gnss_t message = to_message(fix);
    if (!outputs.publish(config_.channel, message)) {
      ++late_;
      continue;
    }
    ++published_;
    newest_utime_ = fix.t_us;
    if (fix.fix_type != FixType::kNone) last_position_ = fix.antenna;
  }
}

std::vector<StreamCounters> GnssDriver::counters() const {
  StreamCounters ubx, nmea, messages;
  ubx = {"UBX", framer_.frames(kUbx), ubx_.used, framer_.bad_checksums(kUbx), ubx_.refused, 0, 0, 0};
  nmea = {"NMEA", framer_.frames(kNmea), nmea_.used, framer_.bad_checksums(kNmea), nmea_.refused, 0, 0, 0};
  messages = {config_.channel, published_ + late_,      published_,   0, epochs_.refused(),
              late_,           framer_.skipped_bytes(), newest_utime_};
  return {messages, ubx, nmea};
}

std::optional<std::string> GnssDriver::position_for_caster(int64_t now_utime) const {
  if (!last_position_) return std::nullopt;
  const auto angle = [](double radians, int degree_digits) {
    const double degrees = std::abs(radians) / kDegree;
    // Rounded once, in units of the last digit, so that no minutes of 60 appear.
    const auto units = static_cast<int64_t>(std::llround(degrees * 60.0 * 1e4));
    const int64_t whole = units / 600'000, rest = units % 600'000;
    return fmt::format("{:0{}}{:02}.{:04}", whole, degree_digits, rest / 10'000, rest % 10'000);
  };
  const int64_t s = now_utime / 1'000'000 % 86'400;
  const std::string body = fmt::format("GPGGA,{:02}{:02}{:02}.00,{},{},{},{},1,10,1.0,{:.1f},M,0.0,M,,", s / 3600,
                                       s / 60 % 60, s % 60, angle(last_position_->latitude, 2),
                                       last_position_->latitude < 0.0 ? 'S' : 'N', angle(last_position_->longitude, 3),
                                       last_position_->longitude < 0.0 ? 'W' : 'E', last_position_->height);
  const auto* bytes = reinterpret_cast<const uint8_t*>(body.data());
  return fmt::format("${}*{:02X}\r\n", body, nmea_checksum({bytes, body.size()}));
}

}  // namespace roadfix
