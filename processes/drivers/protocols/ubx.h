/// UBX, the binary protocol of u-blox receivers. Facts: u-blox F9 HPG 1.32 interface description, UBX-22008968 (3.2
/// frame, 3.15.13 NAV-PVT, 3.15.15 NAV-RELPOSNED, 3.15.5 NAV-EOE); version 0 of NAV-RELPOSNED: u-blox 8 / M8 receiver
/// description UBX-13003221, 32.17.20.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "drivers/protocols/framer.h"

namespace roadfix {

Probe probe_ubx(std::span<const uint8_t> bytes);

struct UbxFrame {
  uint8_t message_class = 0;
  uint8_t id = 0;
  std::span<const uint8_t> payload;

  [[nodiscard]] bool is(uint8_t wanted_class, uint8_t wanted_id) const {
    return message_class == wanted_class && id == wanted_id;
  }
};
inline constexpr uint8_t kUbxNav = 0x01, kUbxNavPvt = 0x07, kUbxNavRelPosNed = 0x3C, kUbxNavEoe = 0x61;

/// `frame`: a whole one, as probe_ubx() found it.
UbxFrame ubx_frame(std::span<const uint8_t> frame);

/// The navigation solution of one epoch, in the receiver's units.
struct UbxNavPvt {
  uint32_t time_of_week_ms = 0;
  std::optional<int64_t> utc_us;  ///< since 1970; absent where the receiver knows date or time not yet
  uint8_t fix_type = 0;           ///< 0 none, 1 dead reckoning, 2 2D, 3 3D, 4 GNSS and dead reckoning, 5 time only
  bool fix_ok = false;            ///< within the receiver's limits of DOP and accuracy
  bool differential = false;
  uint8_t carrier_solution = 0;  ///< 0 none, 1 float, 2 fixed
  bool position_invalid = false;
  uint8_t num_satellites = 0;
  int32_t lon_1e7_deg = 0;
  int32_t lat_1e7_deg = 0;
  int32_t height_mm = 0;  ///< above the ellipsoid
  uint32_t horizontal_accuracy_mm = 0;
  uint32_t vertical_accuracy_mm = 0;
  int32_t velocity_ned_mmps[3] = {};
  uint32_t speed_accuracy_mmps = 0;
  uint16_t pdop_1e2 = 0;
  uint8_t correction_age_class = 0;  ///< 0 not known, 1 under 1 s, 2 under 2 s, ... 12 over 120 s
};

/// Absent where the payload is none.
std::optional<UbxNavPvt> parse_nav_pvt(std::span<const uint8_t> payload);
/// The longest age that the class stands for; absent where there are no corrections.
std::optional<double> ubx_correction_age_s(uint8_t correction_age_class);

/// The vector from the reference station (or the moving base) to the antenna.
struct UbxNavRelPosNed {
  uint32_t time_of_week_ms = 0;
  double north_m = 0.0, east_m = 0.0, down_m = 0.0;
  double length_m = 0.0;
  double heading_deg = 0.0;  ///< of the vector, clockwise from true north
  double heading_accuracy_deg = 0.0;
  uint8_t carrier_solution = 0;  ///< 0 none, 1 float, 2 fixed
  bool valid = false;            ///< the vector
  bool heading_valid = false;
  bool moving_base = false;
};

/// Versions 0 (40 bytes; the heading is computed from the vector) and 1 (64 bytes).
std::optional<UbxNavRelPosNed> parse_nav_relposned(std::span<const uint8_t> payload);

/// The epoch (ms of the week) whose last message has come.
std::optional<uint32_t> parse_nav_eoe(std::span<const uint8_t> payload);

}  // namespace roadfix
