/// Makes the checksums in a stream of bytes right, so that damage to a frame's contents gets past them.
#pragma once

#include <cstdint>
#include <span>

namespace roadfix::test {

enum class SealKind { kNone, kUbx, kNmea, kSbg, kRtcm };

/// In place; what is no frame of the protocol but for its checksum stays as it is.
void seal(SealKind kind, std::span<uint8_t> stream);

}  // namespace roadfix::test
