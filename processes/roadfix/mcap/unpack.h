/// Chunks packed by zstd, lz4 (frames) and bzip2, with a size that is declared beforehand and used within limits.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace roadfix {

/// `name`: "zstd", "lz4", "bz2"; "" and "none" are not packed. Empty where all is well, else what is wrong; `out` then
/// holds nothing of use.
std::string unpack(const std::string& name, std::span<const uint8_t> packed, uint64_t size, std::vector<uint8_t>& out);

}  // namespace roadfix
