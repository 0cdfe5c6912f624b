#include "stream/digest.h"

#include <xxhash.h>

namespace roadfix {

uint64_t Digest::value(uint64_t seed) const { return XXH3_64bits_withSeed(bytes_.data(), bytes_.size(), seed); }

void Digest::add_raw(const void* data, std::size_t size) {
  const auto* begin = static_cast<const uint8_t*>(data);
  bytes_.insert(bytes_.end(), begin, begin + size);
}

uint64_t chain_digest(uint64_t previous, std::span<const uint8_t> bytes) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), previous);
}

}  // namespace roadfix
