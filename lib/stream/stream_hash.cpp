#include "stream/stream_hash.h"

#define XXH_STATIC_LINKING_ONLY  // the size of its state
#include <xxhash.h>

namespace roadfix {

struct StreamHash::State {
  XXH64_state_t xxh{};
};

StreamHash::StreamHash() : state_(std::make_unique<State>()) { XXH64_reset(&state_->xxh, 0); }
StreamHash::~StreamHash() = default;

void StreamHash::add(const void* data, std::size_t size) { XXH64_update(&state_->xxh, data, size); }

uint64_t StreamHash::value() const { return XXH64_digest(&state_->xxh); }

}  // namespace roadfix
