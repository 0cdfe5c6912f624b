/// Reads one whole MCAP file, message by message in its order; ConfigError with file and offset where it is damaged or
/// cut short. The CRC of each chunk is checked.
#pragma once

#include <optional>

#include "roadfix/mcap/byte_cursor.h"
#include "roadfix/mcap/mcap_format.h"

namespace roadfix {

/// Where a message lies: offset of its chunk in the file (0: in none), offset of its record there.
struct McapPlace {
  uint64_t chunk = 0;
  uint64_t record = 0;
};

class McapReader {
 public:
  struct Message {
    uint16_t channel = 0;
    uint64_t log_time = 0;          ///< ns
    uint64_t publish_time = 0;      ///< ns
    std::span<const uint8_t> data;  ///< until the next call
    McapPlace place;
  };

  /// `bytes` outlive it; `name` is what errors call them.
  McapReader(std::span<const uint8_t> bytes, const std::string& name);

  /// The next message of a channel that was declared before; nothing at the end.
  std::optional<Message> next();
  /// A message that next() gave before.
  Message at(const McapPlace& place);

  [[nodiscard]] const std::map<uint16_t, McapChannel>& channels() const { return channels_; }
  [[nodiscard]] const std::map<uint16_t, McapSchema>& schemas() const { return schemas_; }
  [[nodiscard]] const std::string& profile() const { return profile_; }

 private:
  struct Record {
    McapOp op;
    ByteCursor content;
  };

  static Record take_record(ByteCursor& from);
  void open_chunk(uint64_t offset, ByteCursor content);
  void take_schema(ByteCursor content);
  void take_channel(ByteCursor content);
  [[nodiscard]] Message message(ByteCursor content, const McapPlace& place) const;

  BytePlace file_;
  std::span<const uint8_t> bytes_;
  ByteCursor cursor_;
  std::string profile_;
  std::map<uint16_t, McapSchema> schemas_;
  std::map<uint16_t, McapChannel> channels_;
  BytePlace chunk_place_;
  std::vector<uint8_t> chunk_;
  std::optional<ByteCursor> in_chunk_;  ///< what next() has left of it
  bool done_ = false;
};

}  // namespace roadfix
