// ROS 1 bags, version 2.0 (wiki.ros.org/Bags/Format/2.0): records of a header of "name=value" fields and data; messages
// in chunks that may be packed, an index of connections and chunks at the end.
#include <map>
#include <optional>

#include "roadfix/mcap/byte_cursor.h"
#include "roadfix/mcap/mapped_file.h"
#include "roadfix/mcap/unpack.h"
#include "roadfix/rosbag/bag.h"

namespace roadfix {
namespace {

constexpr std::string_view kMagic = "#ROSBAG V2.0\n";
enum Op : uint8_t { kMessageData = 2, kBagHeader = 3, kIndexData = 4, kChunk = 5, kChunkInfo = 6, kConnection = 7 };

using Fields = std::map<std::string, std::span<const uint8_t>, std::less<>>;

Fields take_fields(ByteCursor cursor) {
  Fields fields;
  while (!cursor.at_end()) {
    ByteCursor field = cursor.part(cursor.number<uint32_t>("a header field's length"), "a header field");
    const std::span<const uint8_t> bytes = field.take(field.left(), "a header field");
    const auto equal = std::find(bytes.begin(), bytes.end(), '=');
    if (equal == bytes.end()) cursor.fail("a header field without '='");
    fields[std::string(bytes.begin(), equal)] = bytes.subspan(static_cast<std::size_t>(equal - bytes.begin()) + 1);
  }
  return fields;
}

struct Record {
  Fields fields;
  ByteCursor data;

  template <class Unsigned>
  [[nodiscard]] Unsigned number(const char* name) const {
    const auto found = fields.find(name);
    if (found == fields.end() || found->second.size() != sizeof(Unsigned)) {
      data.fail(std::string("the record's field '") + name + "' is missing or of another length");
    }
    Unsigned value = 0;
    for (std::size_t i = 0; i < sizeof value; ++i) {
      value = static_cast<Unsigned>(value | (static_cast<Unsigned>(found->second[i]) << (8U * i)));
    }
    return value;
  }
  [[nodiscard]] std::string text(const char* name) const {
    const auto found = fields.find(name);
    if (found == fields.end()) data.fail(std::string("the record's field '") + name + "' is missing");
    return {found->second.begin(), found->second.end()};
  }
};

Record take_record(ByteCursor& cursor) {
  ByteCursor header = cursor.part(cursor.number<uint32_t>("a record's header length"), "a record's header");
  ByteCursor data = cursor.part(cursor.number<uint32_t>("a record's data length"), "a record's data");
  return {take_fields(header), data};
}

class Ros1Bag : public Bag {
 public:
  explicit Ros1Bag(const std::filesystem::path& path)
      : file_(std::in_place, path), bytes_(file_->bytes()), place_{path.string()} {}
  Ros1Bag(std::span<const uint8_t> bytes, std::string name) : bytes_(bytes), place_{std::move(name)} {}

  void read(const Visitor& visitor) override {
    ByteCursor cursor(bytes_, place_);
    const auto magic = cursor.take(kMagic.size(), "the bag's first line");
    if (!std::equal(magic.begin(), magic.end(), kMagic.begin())) {
      throw ConfigError(place_.file, 0, "at offset 0: is no ROS bag of version 2.0");
    }
    const Record head = take_record(cursor);
    if (head.number<uint8_t>("op") != kBagHeader) head.data.fail("the first record must be the bag's header");
    const auto index = head.number<uint64_t>("index_pos");
    if (index == 0) head.data.fail("the bag was not closed, it has no index (`rosbag reindex` makes one)");
    Counts declared{head.number<uint32_t>("conn_count"), head.number<uint32_t>("chunk_count")};
    Counts found;
    while (!cursor.at_end()) take_one(cursor, visitor, found);
    if (found.connections != declared.connections || found.chunks != declared.chunks) {
      cursor.fail(fmt::format("the index has {} connections and {} chunks, the bag's header says {} and {}",
                              found.connections, found.chunks, declared.connections, declared.chunks));
    }
  }

  std::vector<uint8_t> data_at(const BagPlace& place) override {
    if (place.chunk != 0 && place.chunk != open_chunk_) {
      ByteCursor cursor(bytes_.subspan(static_cast<std::size_t>(place.chunk)), place_, place.chunk);
      const Record record = take_record(cursor);
      open_chunk(place.chunk, record);
    }
    const std::span<const uint8_t> from = place.chunk != 0 ? std::span<const uint8_t>(chunk_) : bytes_;
    ByteCursor cursor(from.subspan(static_cast<std::size_t>(place.record)), place_, place.record);
    Record record = take_record(cursor);
    const auto data = record.data.take(record.data.left(), "a message");
    return {data.begin(), data.end()};
  }

 private:
  struct Counts {
    uint32_t connections = 0;  ///< of the index, behind the chunks
    uint32_t chunks = 0;
  };

  void take_one(ByteCursor& cursor, const Visitor& visitor, Counts& found) {
    const uint64_t offset = cursor.offset();
    const Record record = take_record(cursor);
    switch (record.number<uint8_t>("op")) {
      case kChunk: {
        open_chunk(offset, record);
        ByteCursor inside(chunk_, chunk_place_);
        while (!inside.at_end()) take_inner(inside, visitor);
        break;
      }
      case kConnection:
        take_connection(record);
        ++found.connections;
        break;
      case kChunkInfo:
        ++found.chunks;
        break;
      case kMessageData:
        take_message(record, visitor, {0, 0, offset});
        break;
      default:
        break;  // index data: what the chunk itself says
    }
  }

  void take_inner(ByteCursor& cursor, const Visitor& visitor) {
    const uint64_t offset = cursor.offset();
    const Record record = take_record(cursor);
    const auto op = record.number<uint8_t>("op");
    if (op == kConnection) take_connection(record);
    if (op == kMessageData) take_message(record, visitor, {0, open_chunk_, offset});
  }

  void open_chunk(uint64_t offset, Record record) {
    chunk_place_ = {place_.file, true, offset};
    const auto packed = record.data.take(record.data.left(), "a chunk");
    const std::string error = unpack(record.text("compression"), packed, record.number<uint32_t>("size"), chunk_);
    open_chunk_ = offset;
    if (!error.empty()) ByteCursor(chunk_, chunk_place_).fail(error);
  }

  void take_connection(const Record& record) {
    const auto id = record.number<uint32_t>("conn");
    if (connections_.contains(id)) return;
    const Record inner{take_fields(record.data), record.data};
    BagTopic topic;
    topic.name = record.text("topic");
    topic.type = plain_ros_type(inner.text("type"));
    topic.definition = inner.text("message_definition");
    connections_[id] = topic_index(std::move(topic));
  }

  void take_message(Record record, const Visitor& visitor, const BagPlace& place) {
    const auto connection = connections_.find(record.number<uint32_t>("conn"));
    if (connection == connections_.end()) record.data.fail("a message of a connection that was not told");
    const auto time = record.number<uint64_t>("time");
    constexpr int64_t kSecond = 1'000'000'000;
    const int64_t time_ns = static_cast<int64_t>(time & 0xffffffffU) * kSecond + static_cast<int64_t>(time >> 32U);
    const auto data = record.data.take(record.data.left(), "a message");
    visitor({connection->second, time_ns, data, place});
  }

  std::optional<MappedFile> file_;
  std::span<const uint8_t> bytes_;
  BytePlace place_;
  std::map<uint32_t, std::size_t> connections_;
  std::vector<uint8_t> chunk_;
  BytePlace chunk_place_;
  uint64_t open_chunk_ = 0;
};

}  // namespace

std::unique_ptr<Bag> open_ros1_bag(const std::filesystem::path& path) { return std::make_unique<Ros1Bag>(path); }
std::unique_ptr<Bag> open_ros1_bag(std::span<const uint8_t> bytes, const std::string& name) {
  return std::make_unique<Ros1Bag>(bytes, name);
}

}  // namespace roadfix
