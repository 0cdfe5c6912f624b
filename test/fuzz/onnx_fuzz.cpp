// Whatever bytes stand in a network's file, its declaration reads as one of the two that we can feed.
#include <cstdint>
#include <cstdlib>
#include <span>

#include "features/network.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  const int channels = roadfix::declared_channels(std::span<const uint8_t>(data, size));
  if (channels != 1 && channels != 3) std::abort();
  return 0;
}
