/// NMEA 0183 sentences of a pose, for boxes that want a GNSS receiver. Facts: NMEA 0183 v4.11 as u-blox publishes it
/// (UBX-22008968, chapter 2; "Position fix flags" for quality, status and mode). What is not known is an empty field:
/// nothing is made up, and without a position none is written.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/protocols/nmea.h"

namespace roadfix {

/// Field 6 of GGA; decides status and mode of the other sentences.
enum class NmeaQuality { kNone = 0, kSingle = 1, kDifferential = 2, kRtkFixed = 4, kRtkFloat = 5, kDeadReckoning = 6 };

/// Standard deviations of a position.
struct NmeaDeviations {
  double major_m = 0.0, minor_m = 0.0;  ///< of the horizontal error ellipse
  double orientation_deg = 0.0;         ///< of the major axis, clockwise from true north
  double lat_m = 0.0, lon_m = 0.0, height_m = 0.0;
};

struct NmeaPose {
  int64_t t_us = 0;  ///< UTC
  NmeaQuality quality = NmeaQuality::kNone;
  std::optional<NmeaPosition> position;
  std::optional<double> height_msl_m;
  std::optional<double> geoid_separation_m;  ///< of the geoid above the ellipsoid
  std::optional<int> num_satellites;
  std::optional<double> correction_age_s;
  std::optional<double> speed_mps;    ///< over ground
  std::optional<double> course_deg;   ///< over ground, clockwise from true north
  std::optional<double> heading_deg;  ///< of the vehicle's x axis, clockwise from true north
  std::optional<NmeaDeviations> deviations;
};

/// Whole sentences, checksum and line end included, at most 82 characters. `talker`: two capital letters.
std::string write_gga(const NmeaPose& pose, const std::string& talker);
std::string write_rmc(const NmeaPose& pose, const std::string& talker);
std::string write_vtg(const NmeaPose& pose, const std::string& talker);
std::string write_hdt(const NmeaPose& pose, const std::string& talker);
std::string write_gst(const NmeaPose& pose, const std::string& talker);
std::string write_zda(const NmeaPose& pose, const std::string& talker);

}  // namespace roadfix
