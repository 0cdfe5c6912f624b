/// RTCM 3 frames: corrections for GNSS receivers. Facts: RTCM 10403.3, section 4 (0xD3, 6 reserved bits, 10 bits of
/// length, payload, CRC-24Q).
#pragma once

#include <cstdint>
#include <span>

#include "drivers/protocols/framer.h"

namespace roadfix {

Probe probe_rtcm(std::span<const uint8_t> bytes);

}  // namespace roadfix
