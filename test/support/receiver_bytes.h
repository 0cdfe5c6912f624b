/// What a GNSS receiver would send: epochs in UBX and NMEA, at 48 north, 3.25 west, in May 2024.
#pragma once

#include <cstdio>

#include "drivers/protocols/utc.h"
#include "support/device_bytes.h"

namespace roadfix::test {

/// Ambiguities fixed, 14 mm, 2 m/s east, 1 m/s north, 0.3 m/s up.
inline Bytes pvt_bytes(int64_t utc, uint32_t tow_ms, double lat_deg) {
  const int64_t day_us = utc - *utc_us(2024, 5, 3, 0, 0, 0);
  const int64_t s = day_us / 1'000'000;
  Payload p(92);
  p.at<uint32_t>(0, tow_ms).at<uint16_t>(4, 2024).at<uint8_t>(6, 5).at<uint8_t>(7, static_cast<uint8_t>(3 + s / 86400));
  p.at<uint8_t>(8, static_cast<uint8_t>(s / 3600 % 24)).at<uint8_t>(9, static_cast<uint8_t>(s / 60 % 60));
  p.at<uint8_t>(10, static_cast<uint8_t>(s % 60)).at<uint8_t>(11, 3);
  p.at<int32_t>(16, static_cast<int32_t>(day_us % 1'000'000) * 1000);
  p.at<uint8_t>(20, 3).at<uint8_t>(21, 0x83).at<uint8_t>(23, 17);  // 3D, corrections, ambiguities fixed
  p.at<int32_t>(24, -32'500'000).at<int32_t>(28, static_cast<int32_t>(lat_deg * 1e7)).at<int32_t>(32, 167'500);
  p.at<int32_t>(36, 120'000).at<uint32_t>(40, 14).at<uint32_t>(44, 20);
  p.at<int32_t>(48, 1000).at<int32_t>(52, 2000).at<int32_t>(56, -300);
  p.at<uint32_t>(68, 50).at<uint16_t>(76, 145).at<uint8_t>(78, 1U << 2U);
  return ubx_bytes(1, 7, p.bytes());
}

/// Version 1, of a moving base.
inline Bytes relposned_bytes(uint32_t tow_ms, double heading_deg) {
  Payload p(64);
  p.at<uint8_t>(0, 1).at<uint32_t>(4, tow_ms).at<int32_t>(24, static_cast<int32_t>(heading_deg * 1e5));
  p.at<uint32_t>(52, 20'000).at<uint32_t>(60, (1U << 2U) | (2U << 3U) | (1U << 5U) | (1U << 8U));
  return ubx_bytes(1, 0x3C, p.bytes());
}

/// RMC, GGA, GSA and perhaps GST; `heights` as in GGA, "120.0,M,47.5,M".
inline Bytes nmea_epoch_bytes(int64_t utc, bool gst, const std::string& quality, const std::string& heights) {
  const int64_t s = utc / 1'000'000 % 86'400;
  char time[16];
  std::snprintf(time, sizeof time, "%02d%02d%02d.%02d", static_cast<int>(s / 3600), static_cast<int>(s / 60 % 60),
                static_cast<int>(s % 60), static_cast<int>(utc / 10'000 % 100));
  const std::string t = time;
  Bytes bytes = nmea_bytes("GNRMC," + t + ",A,4800.0000,N,00315.0000,W,19.438445,270.0,030524,,,A");
  append(bytes, nmea_bytes("GNGGA," + t + ",4800.0000,N,00315.0000,W," + quality + ",12,1.5," + heights + ",,"));
  append(bytes, nmea_bytes("GNGSA,A,3,,,,,,,,,,,,,2.5,1.5,2.0"));
  if (gst) append(bytes, nmea_bytes("GNGST," + t + ",1,,,,0.3,0.4,0.9"));
  return bytes;
}

}  // namespace roadfix::test
