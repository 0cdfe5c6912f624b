/// The MCAP container (mcap.dev/spec, version 0): magic, then records of an opcode, a length and fields, all
/// little-endian; messages in chunks that may be packed; at the end a summary by which readers find chunks.
#pragma once

#include <zlib.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace roadfix {

constexpr std::array<uint8_t, 8> kMcapMagic = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
constexpr std::size_t kMcapHeadBytes = 9;  ///< of a record: opcode and length

enum class McapOp : uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0b,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f
};

/// Fields one behind the other, as MCAP writes them.
class McapFields {
 public:
  template <class Unsigned>
  void number(Unsigned value) {
    uint8_t bytes[sizeof value];
    for (std::size_t i = 0; i < sizeof value; ++i) bytes[i] = static_cast<uint8_t>(value >> (8 * i));
    append(bytes);
  }
  void text(std::string_view value) {
    number(static_cast<uint32_t>(value.size()));
    append({reinterpret_cast<const uint8_t*>(value.data()), value.size()});
  }
  void append(std::span<const uint8_t> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }

  /// Opcode and length of a record whose content follows.
  void head(McapOp op, std::size_t size) {
    bytes_.push_back(static_cast<uint8_t>(op));
    number(static_cast<uint64_t>(size));
  }
  void record(McapOp op, const McapFields& content) {
    head(op, content.size());
    append(content.bytes());
  }

  [[nodiscard]] std::span<const uint8_t> bytes() const { return bytes_; }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  void clear() { bytes_.clear(); }

 private:
  std::vector<uint8_t> bytes_;
};

/// zlib's CRC-32, which MCAP uses, continued from `start`.
inline uint32_t crc32_of(std::span<const uint8_t> bytes, uint32_t start = 0) {
  return static_cast<uint32_t>(crc32_z(start, bytes.data(), bytes.size()));
}

struct McapSchema {
  std::string name;
  std::string encoding;
  std::vector<uint8_t> data;
};

struct McapChannel {
  uint16_t schema = 0;  ///< 0: none
  std::string topic;
  std::string encoding;  ///< of its messages
};

}  // namespace roadfix
