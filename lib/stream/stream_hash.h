/// Incremental XXH64, equal to the output of `xxhsum FILE`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace roadfix {

class StreamHash {
 public:
  StreamHash();
  ~StreamHash();
  StreamHash(const StreamHash&) = delete;
  StreamHash& operator=(const StreamHash&) = delete;

  void add(const void* data, std::size_t size);
  [[nodiscard]] uint64_t value() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace roadfix
