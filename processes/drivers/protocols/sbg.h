/// sbgECom, the binary protocol of SBG Systems' inertial sensors (Ellipse). Facts: "sbgECom Binary Protocol" firmware
/// reference, published in github.com/SBG-Systems/sbgECom (frame definition; SBG_ECOM_LOG_IMU_SHORT, EKF_QUAT,
/// EKF_NAV, GPSX_POS, GPSX_VEL, GPSX_HDT). Axes and units here are the device's: body x forward, y right, z down;
/// north, east, down. Pages of large frames are passed over.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "drivers/protocols/framer.h"

namespace roadfix {

Probe probe_sbg(std::span<const uint8_t> bytes);

struct SbgFrame {
  uint8_t message_class = 0;
  uint8_t id = 0;
  std::span<const uint8_t> payload;
};
inline constexpr uint8_t kSbgClassLog = 0;
inline constexpr uint8_t kSbgEkfQuat = 7, kSbgEkfNav = 8, kSbgGps1Vel = 13, kSbgGps1Pos = 14, kSbgGps1Hdt = 15,
                         kSbgImuShort = 44;

/// `frame`: a whole one, as probe_sbg() found it.
SbgFrame sbg_frame(std::span<const uint8_t> frame);

/// Every log begins with the time since the device was switched on, which wraps after 2^32 us = 71.6 min.
struct SbgImuShort {
  uint32_t time_us = 0;
  bool healthy = false;   ///< connected, built-in tests passed
  bool in_range = false;  ///< neither gyroscope nor accelerometer clips
  double accel_mps2[3] = {};
  double gyro_radps[3] = {};
  double temperature_c = 0.0;
};

/// What the filter says of itself (SOLUTION_STATUS).
struct SbgSolution {
  uint8_t mode = 0;  ///< 4: attitude, velocity and position
  bool attitude_valid = false, heading_valid = false, velocity_valid = false, position_valid = false;
};

struct SbgEkfNav {
  uint32_t time_us = 0;
  double velocity_ned_mps[3] = {}, velocity_std_ned_mps[3] = {};
  double lat_deg = 0.0, lon_deg = 0.0;
  double height_msl_m = 0.0;
  double undulation_m = 0.0;  ///< of the geoid above the ellipsoid
  double position_std_ned_m[3] = {};
  SbgSolution solution;
};

struct SbgEkfQuat {
  uint32_t time_us = 0;
  double q_ned_body_wxyz[4] = {};
  double roll_pitch_yaw_std_rad[3] = {};
  SbgSolution solution;
};

enum class SbgPositionType { kNone, kUnknown, kSingle, kDifferential, kRtkFloat, kRtkFixed };

struct SbgGpsPos {
  uint32_t time_us = 0;
  SbgPositionType type = SbgPositionType::kNone;  ///< kNone also where the status is not "computed"
  uint32_t time_of_week_ms = 0;
  double lat_deg = 0.0, lon_deg = 0.0;
  double height_msl_m = 0.0;
  double undulation_m = 0.0;
  double std_north_m = 0.0, std_east_m = 0.0, std_up_m = 0.0;
  std::optional<int> num_satellites;
  std::optional<double> correction_age_s;
};

struct SbgGpsVel {
  uint32_t time_us = 0;
  bool computed = false;
  uint32_t time_of_week_ms = 0;
  double velocity_ned_mps[3] = {}, std_ned_mps[3] = {};
};

struct SbgGpsHdt {
  uint32_t time_us = 0;
  bool computed = false;
  uint32_t time_of_week_ms = 0;
  double heading_deg = 0.0, heading_std_deg = 0.0;
  double pitch_deg = 0.0;
};

/// Each absent where the payload is too short. Newer firmware appends fields: what follows the known ones is ignored.
std::optional<SbgImuShort> parse_sbg_imu_short(std::span<const uint8_t> payload);
std::optional<SbgEkfNav> parse_sbg_ekf_nav(std::span<const uint8_t> payload);
std::optional<SbgEkfQuat> parse_sbg_ekf_quat(std::span<const uint8_t> payload);
std::optional<SbgGpsPos> parse_sbg_gps_pos(std::span<const uint8_t> payload);
std::optional<SbgGpsVel> parse_sbg_gps_vel(std::span<const uint8_t> payload);
std::optional<SbgGpsHdt> parse_sbg_gps_hdt(std::span<const uint8_t> payload);

}  // namespace roadfix
