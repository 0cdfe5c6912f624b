/// Reads little-endian fields of a file in memory; what does not fit is a ConfigError that names file and offset.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "config/config_error.h"

namespace roadfix {

/// Where bytes come from, for errors: a file, or a chunk that was unpacked from it.
struct BytePlace {
  std::string file;
  bool is_unpacked = false;  ///< offsets then count within the chunk
  uint64_t chunk = 0;        ///< its offset in the file
};

class ByteCursor {
 public:
  /// `base`: where `bytes` begin in the file or the unpacked chunk.
  ByteCursor(std::span<const uint8_t> bytes, const BytePlace& place, uint64_t base = 0)
      : bytes_(bytes), place_(&place), base_(base) {}

  [[nodiscard]] std::size_t position() const { return position_; }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] bool at_end() const { return left() == 0; }
  /// In the file, or in the unpacked chunk.
  [[nodiscard]] uint64_t offset() const { return base_ + position_; }

  template <class Unsigned>
  Unsigned number(const char* what) {
    const std::span<const uint8_t> raw = take(sizeof(Unsigned), what);
    Unsigned value = 0;
    for (std::size_t i = 0; i < raw.size(); ++i) {
      value = static_cast<Unsigned>(value | (static_cast<Unsigned>(raw[i]) << (8U * i)));
    }
    return value;
  }
  std::span<const uint8_t> take(uint64_t size, const char* what) {
    if (size > left()) fail(fmt::format("{} needs {} bytes, {} are left", what, size, left()));
    const std::span<const uint8_t> taken = bytes_.subspan(position_, static_cast<std::size_t>(size));
    position_ += taken.size();
    return taken;
  }
  /// The next bytes as a cursor of their own.
  ByteCursor part(uint64_t size, const char* what) {
    const uint64_t base = offset();
    return {take(size, what), *place_, base};
  }
  std::string_view text(const char* what) {
    const std::span<const uint8_t> raw = take(number<uint32_t>(what), what);
    return {reinterpret_cast<const char*>(raw.data()), raw.size()};
  }
  [[noreturn]] void fail(const std::string& what) const {
    if (place_->is_unpacked) {
      throw ConfigError(place_->file, 0,
                        fmt::format("at offset {}, byte {} of the unpacked chunk: {}", place_->chunk, offset(), what));
    }
    throw ConfigError(place_->file, 0, fmt::format("at offset {}: {}", offset(), what));
  }

 private:
  std::span<const uint8_t> bytes_;
  const BytePlace* place_;
  uint64_t base_;
  std::size_t position_ = 0;
};

}  // namespace roadfix
