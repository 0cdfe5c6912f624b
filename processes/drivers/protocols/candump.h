/// CAN frames as lines of text, as candump -L of can-utils writes and canplayer reads them:
///   (1436509052.249713) can0 044#2A366C2BBA        standard identifier, up to 8 bytes
///   (1436509052.249713) can0 18FEF100#R            remote request of an extended identifier
///   (1436509052.249713) can0 123##1AABB            CAN FD: a digit of flags, up to 64 bytes
/// Facts: can-utils, lib.h ("CAN frame ASCII representation"). The raw bytes of a CAN bus are kept in this form.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/protocols/framer.h"

namespace roadfix {

struct CanFrame {
  int64_t t_us = 0;  ///< wall clock of the computer that received it
  uint32_t id = 0;
  bool extended = false;  ///< 29 bits of identifier
  bool remote = false;    ///< carries no data
  bool error = false;     ///< of the controller, no frame of the bus
  uint8_t size = 0;
  std::array<uint8_t, 64> data{};
};

/// A line with its line feed, of any contents; parse_can_line() says whether it is one of candump's.
Probe probe_can_line(std::span<const uint8_t> bytes);

/// False where the line is malformed.
bool parse_can_line(std::span<const uint8_t> line, CanFrame& frame);

/// The line of a frame, with its line feed.
std::string can_line(const CanFrame& frame, const std::string& interface);

}  // namespace roadfix
