// rosbag2's MCAP files, and whatever else writes ROS messages into MCAP.
#include <optional>

#include "roadfix/mcap/mapped_file.h"
#include "roadfix/mcap/mcap_reader.h"
#include "roadfix/rosbag/bag.h"

namespace roadfix {
namespace {

class McapBag : public Bag {
 public:
  explicit McapBag(const std::filesystem::path& path)
      : file_(std::in_place, path), bytes_(file_->bytes()), name_(path.string()) {}
  McapBag(std::span<const uint8_t> bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  void read(const Visitor& visitor) override {
    McapReader reader(bytes_, name_);
    std::map<uint16_t, std::size_t> topics;
    while (const auto message = reader.next()) {
      const auto [found, is_new] = topics.try_emplace(message->channel);
      if (is_new) found->second = topic_index(topic(reader, reader.channels().at(message->channel)));
      visitor({found->second,
               static_cast<int64_t>(message->log_time),
               message->data,
               {0, message->place.chunk, message->place.record}});
    }
  }

  std::vector<uint8_t> data_at(const BagPlace& place) override {
    if (!again_) again_.emplace(bytes_, name_), static_cast<void>(drained());
    const auto data = again_->at({place.chunk, place.record}).data;
    return {data.begin(), data.end()};
  }

 private:
  /// at() needs the channels that next() finds; the reader has them all at the end.
  bool drained() {
    while (again_->next()) {
    }
    return true;
  }

  static BagTopic topic(const McapReader& reader, const McapChannel& channel) {
    BagTopic topic;
    topic.name = channel.topic;
    topic.encoding = channel.encoding == "ros1" ? RosType::Encoding::kRos1 : RosType::Encoding::kCdr;
    topic.readable = channel.encoding == "ros1" || channel.encoding == "cdr";
    const auto schema = reader.schemas().find(channel.schema);
    if (schema == reader.schemas().end()) {
      topic.readable = false;
      return topic;
    }
    topic.type = plain_ros_type(schema->second.name);
    if (schema->second.encoding == "ros1msg" || schema->second.encoding == "ros2msg") {
      topic.definition.assign(schema->second.data.begin(), schema->second.data.end());
    }
    return topic;
  }

  std::optional<MappedFile> file_;
  std::span<const uint8_t> bytes_;
  std::string name_;
  std::optional<McapReader> again_;
};

}  // namespace

std::unique_ptr<Bag> open_mcap_bag(const std::filesystem::path& path) { return std::make_unique<McapBag>(path); }
std::unique_ptr<Bag> open_mcap_bag(std::span<const uint8_t> bytes, const std::string& name) {
  return std::make_unique<McapBag>(bytes, name);
}

}  // namespace roadfix
