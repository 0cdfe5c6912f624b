#include "roadfix/mcap/mcap_reader.h"

#include <algorithm>

#include "roadfix/mcap/unpack.h"

namespace roadfix {
namespace {

bool is_magic(std::span<const uint8_t> bytes) { return std::equal(bytes.begin(), bytes.end(), kMcapMagic.begin()); }

}  // namespace

McapReader::McapReader(std::span<const uint8_t> bytes, const std::string& name)
    : file_{name}, bytes_(bytes), cursor_(bytes, file_) {
  if (!is_magic(cursor_.take(kMcapMagic.size(), "MCAP's magic")))
    throw ConfigError(name, 0, "at offset 0: is no MCAP file");
  if (bytes.size() < 2 * kMcapMagic.size() || !is_magic(bytes.last(kMcapMagic.size()))) {
    throw ConfigError(name, 0,
                      fmt::format("at offset {}: is cut short, the magic at the end is missing (`mcap recover` saves "
                                  "what is there)",
                                  bytes.size()));
  }
  Record header = take_record(cursor_);
  if (header.op != McapOp::kHeader) header.content.fail("the first record must be the header");
  profile_ = header.content.text("the profile");
}

McapReader::Record McapReader::take_record(ByteCursor& from) {
  const auto op = static_cast<McapOp>(from.number<uint8_t>("a record"));
  const auto size = from.number<uint64_t>("a record's length");
  return {op, from.part(size, "a record")};
}

void McapReader::take_schema(ByteCursor content) {
  const auto id = content.number<uint16_t>("a schema's id");
  McapSchema schema;
  schema.name = content.text("a schema's name");
  schema.encoding = content.text("a schema's encoding");
  const auto size = content.number<uint32_t>("a schema's length");
  const std::span<const uint8_t> data = content.take(size, "a schema");
  schema.data.assign(data.begin(), data.end());
  if (id != 0) schemas_[id] = std::move(schema);
}

void McapReader::take_channel(ByteCursor content) {
  const auto id = content.number<uint16_t>("a channel's id");
  McapChannel channel;
  channel.schema = content.number<uint16_t>("a channel's schema");
  channel.topic = content.text("a channel's topic");
  channel.encoding = content.text("a channel's encoding");
  if (channel.schema != 0 && !schemas_.contains(channel.schema)) {
    content.fail(fmt::format("channel {} has schema {}, which was not told", channel.topic, channel.schema));
  }
  channels_[id] = std::move(channel);
}

void McapReader::open_chunk(uint64_t offset, ByteCursor content) {
  static_cast<void>(content.take(16, "a chunk's times"));
  const auto size = content.number<uint64_t>("a chunk's size");
  const auto crc = content.number<uint32_t>("a chunk's CRC");
  const std::string compression(content.text("a chunk's compression"));
  const auto packed_size = content.number<uint64_t>("a chunk's packed size");
  const std::span<const uint8_t> packed = content.take(packed_size, "a chunk");
  chunk_place_ = {file_.file, true, offset};
  const std::string error = unpack(compression, packed, size, chunk_);
  const ByteCursor unpacked(chunk_, chunk_place_);
  if (!error.empty()) unpacked.fail(error);
  if (crc != 0 && crc32_of(chunk_) != crc) unpacked.fail("the chunk's CRC differs: it is damaged");
}

McapReader::Message McapReader::message(ByteCursor content, const McapPlace& place) const {
  Message message;
  message.channel = content.number<uint16_t>("a message's channel");
  static_cast<void>(content.number<uint32_t>("a message's sequence"));
  message.log_time = content.number<uint64_t>("a message's time");
  message.publish_time = content.number<uint64_t>("a message's time");
  message.data = content.take(content.left(), "a message");
  message.place = place;
  if (!channels_.contains(message.channel)) {
    content.fail(fmt::format("a message of channel {}, which was not told", message.channel));
  }
  return message;
}

std::optional<McapReader::Message> McapReader::next() {
  while (!done_) {
    if (in_chunk_ && in_chunk_->at_end()) in_chunk_.reset();
    ByteCursor& from = in_chunk_ ? *in_chunk_ : cursor_;
    const uint64_t offset = from.offset();
    Record record = take_record(from);
    switch (record.op) {
      case McapOp::kSchema:
        take_schema(record.content);
        break;
      case McapOp::kChannel:
        take_channel(record.content);
        break;
      case McapOp::kMessage:
        return message(record.content, {in_chunk_ ? chunk_place_.chunk : 0, offset});
      case McapOp::kChunk:
        if (in_chunk_) record.content.fail("a chunk within a chunk");
        open_chunk(offset, record.content);
        in_chunk_.emplace(chunk_, chunk_place_);
        break;
      case McapOp::kDataEnd:
      case McapOp::kFooter:
        done_ = true;
        break;
      default:
        break;  // indices, attachments, metadata, and what later versions add
    }
  }
  return std::nullopt;
}

McapReader::Message McapReader::at(const McapPlace& place) {
  in_chunk_.reset();
  if (place.chunk != 0 && (chunk_place_.chunk != place.chunk || chunk_.empty())) {
    ByteCursor chunk(bytes_.subspan(static_cast<std::size_t>(place.chunk)), file_, place.chunk);
    Record record = take_record(chunk);
    open_chunk(place.chunk, record.content);
  }
  const std::span<const uint8_t> from = place.chunk != 0 ? std::span<const uint8_t>(chunk_) : bytes_;
  const BytePlace& where = place.chunk != 0 ? chunk_place_ : file_;
  ByteCursor cursor(from.subspan(static_cast<std::size_t>(place.record)), where, place.record);
  return message(take_record(cursor).content, place);
}

}  // namespace roadfix
