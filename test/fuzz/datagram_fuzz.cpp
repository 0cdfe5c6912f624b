// Any bytes as a row of datagrams, each behind its sender (1 byte) and size (2 bytes): what comes out has a channel's
// name, nothing is larger than what was sent, and what waits stays bounded.
#include <cstdlib>

#include "bus/transport/datagrams.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  constexpr std::size_t kHead = 3, kLongestName = 63, kMostWaiting = 4096;
  roadfix::Datagrams datagrams([](std::string_view channel) { return channel != "UNWANTED"; });
  std::span<const uint8_t> rest(data, size);
  while (rest.size() >= kHead) {
    const uint8_t sender = rest[0];
    const std::size_t length = std::min<std::size_t>((std::size_t{rest[1]} << 8) | rest[2], rest.size() - kHead);
    const auto message = datagrams.take(sender, rest.subspan(kHead, length));
    rest = rest.subspan(kHead + length);
    if (!message) continue;
    const bool named = !message->channel.empty() && message->channel.size() <= kLongestName &&
                       message->channel.find('\0') == std::string_view::npos && message->channel != "UNWANTED";
    if (!named || message->bytes.size() > size) std::abort();
  }
  if (datagrams.waiting() > kMostWaiting) std::abort();
  return 0;
}
