/// NMEA 0183 sentences of GNSS receivers. Facts: NMEA 0183 v4.11 as u-blox (UBX-22008968, chapter 2) and Trimble
/// publish it. A sentence without a checksum is refused.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/protocols/framer.h"

namespace roadfix {

Probe probe_nmea(std::span<const uint8_t> bytes);

/// Address and fields, as text; valid as long as the frame's bytes.
struct NmeaSentence {
  std::string_view talker;  ///< for example "GP"; empty for a proprietary sentence
  std::string_view type;    ///< for example "GGA"
  std::vector<std::string_view> fields;
};

/// `frame`: a whole one, as probe_nmea() found it.
NmeaSentence nmea_sentence(std::span<const uint8_t> frame);

/// Microseconds past midnight UTC.
std::optional<int64_t> nmea_time_of_day_us(std::string_view field);

struct NmeaPosition {
  double lat_deg = 0.0;  ///< north positive
  double lon_deg = 0.0;  ///< east positive
};

struct NmeaGga {
  int64_t time_of_day_us = 0;
  int quality = 0;                       ///< 0 none, 1 single, 2 differential, 3 PPS, 4 RTK fixed, 5 RTK float, 6 dead
                                         ///< reckoning, 7 manual, 8 simulator
  std::optional<NmeaPosition> position;  ///< absent without a fix
  std::optional<int> num_satellites;
  std::optional<double> hdop;
  std::optional<double> height_msl_m;
  std::optional<double> geoid_separation_m;  ///< of the geoid above the ellipsoid
  std::optional<double> correction_age_s;
};

/// Speed and course over ground: of RMC, or of VTG, which has no time.
struct NmeaMotion {
  std::optional<int64_t> time_of_day_us;
  bool valid = false;
  std::optional<double> speed_mps;
  std::optional<double> course_deg;  ///< clockwise from true north; absent when standing
};

/// Zeros stand for "not known" and make it absent.
struct NmeaGst {
  int64_t time_of_day_us = 0;
  double north_std_m = 0.0, east_std_m = 0.0, up_std_m = 0.0;
};

/// Each absent where the sentence is of another type, or a field that it cannot do without is missing or malformed.
std::optional<NmeaGga> parse_gga(const NmeaSentence& sentence);
std::optional<NmeaMotion> parse_rmc(const NmeaSentence& sentence);
std::optional<NmeaMotion> parse_vtg(const NmeaSentence& sentence);
std::optional<NmeaGst> parse_gst(const NmeaSentence& sentence);
std::optional<double> parse_gsa_pdop(const NmeaSentence& sentence);
/// HDT, or THS where its mode says that it is measured: deg clockwise from true north.
std::optional<double> parse_heading_deg(const NmeaSentence& sentence);

}  // namespace roadfix
