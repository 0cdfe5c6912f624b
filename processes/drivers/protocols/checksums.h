/// The checksums of the devices' protocols, each with its published check value in test/unit/processes/drivers.
#pragma once

#include <cstdint>
#include <span>

namespace roadfix {

/// The 8-bit Fletcher sums CK_A and CK_B over class, id, length and payload (u-blox F9 interface description
/// UBX-22008968, section 3.4). Returned as CK_A + 256 CK_B: as they stand on the wire, little-endian.
uint16_t ubx_checksum(std::span<const uint8_t> bytes);

/// CRC-16/KERMIT: polynomial 0x1021 reflected, initial value 0 (sbgECom firmware reference, "Frame definition").
uint16_t crc16_sbg(std::span<const uint8_t> bytes);

/// CRC-24Q: polynomial 0x1864CFB, initial value 0 (RTCM 10403.3, section 4.2).
uint32_t crc24q(std::span<const uint8_t> bytes);

/// Exclusive or of all bytes between $ and * (NMEA 0183, section 5.3.1).
uint8_t nmea_checksum(std::span<const uint8_t> bytes);

}  // namespace roadfix
