/// What an SBG Ellipse would send: the logs that the driver reads.
#pragma once

#include <cmath>

#include "drivers/protocols/sbg.h"
#include "geometry/frames.h"
#include "support/device_bytes.h"

namespace roadfix::test {

inline Bytes sbg_imu_bytes(uint32_t t_us, uint16_t status = 0x03FF) {
  Payload p(32);
  p.at<uint32_t>(0, t_us).at<uint16_t>(4, status);
  p.at<int32_t>(6, 1048576).at<int32_t>(10, 2 * 1048576).at<int32_t>(14, -10 * 1048576);  // forward, right, down
  p.at<int32_t>(18, 6710886).at<int32_t>(22, 13421773).at<int32_t>(26, -20132659);
  return sbg_bytes(kSbgImuShort, p.bytes());
}

/// Velocity, position (RTK float) and heading of 30 degrees of one moment.
inline Bytes sbg_gps_bytes(uint32_t t_us, uint32_t tow_ms, double lat_deg = 48.5) {
  Payload pos(57), vel(44), hdt(26);
  pos.at<uint32_t>(0, t_us).at<uint32_t>(4, 6U << 6U).at<uint32_t>(8, tow_ms);
  pos.at<double>(12, lat_deg).at<double>(20, 179.999).at<double>(28, 120.0).at<float>(36, 47.5F);
  pos.at<float>(40, 0.25F).at<float>(44, 0.5F).at<float>(48, 1.0F).at<uint8_t>(52, 14).at<uint16_t>(55, 0xFFFF);
  vel.at<uint32_t>(0, t_us).at<uint32_t>(4, 2U << 6U).at<uint32_t>(8, tow_ms);
  vel.at<float>(12, 1.0F).at<float>(16, 2.0F).at<float>(20, 3.0F);
  vel.at<float>(24, 0.1F).at<float>(28, 0.2F).at<float>(32, 0.3F);
  hdt.at<uint32_t>(0, t_us).at<uint32_t>(6, tow_ms).at<float>(10, 30.0F).at<float>(14, 0.5F);
  Bytes bytes = sbg_bytes(kSbgGps1Vel, vel.bytes());
  append(bytes, sbg_bytes(kSbgGps1Pos, pos.bytes()));
  append(bytes, sbg_bytes(kSbgGps1Hdt, hdt.bytes()));
  return bytes;
}

/// EKF_QUAT and EKF_NAV: level, x forward to the east, 1 m/s north and 2 m/s east, in full navigation.
inline Bytes sbg_solution_bytes(uint32_t t_us, float position_std_north_m = 0.1F) {
  Payload quat(36), nav(72);
  const double half = 45.0 * kDegree;
  quat.at<uint32_t>(0, t_us).at<float>(4, static_cast<float>(std::cos(half)));
  quat.at<float>(16, static_cast<float>(std::sin(half)));
  quat.at<float>(20, 0.001F).at<float>(24, 0.001F).at<float>(28, 0.002F);
  nav.at<uint32_t>(0, t_us).at<float>(4, 1.0F).at<float>(8, 2.0F);
  nav.at<float>(16, 0.03F).at<float>(20, 0.03F).at<float>(24, 0.05F);
  nav.at<double>(28, 48.0).at<double>(36, 2.0).at<double>(44, 100.0).at<float>(52, 44.0F);
  nav.at<float>(56, position_std_north_m).at<float>(60, 0.2F).at<float>(64, 0.3F).at<uint32_t>(68, 0xF4);
  Bytes bytes = sbg_bytes(kSbgEkfQuat, quat.bytes());
  append(bytes, sbg_bytes(kSbgEkfNav, nav.bytes()));
  return bytes;
}

}  // namespace roadfix::test
