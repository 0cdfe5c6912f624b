// Whatever bytes stand in a bag, the readers give messages, or a ConfigError that names the file. The first byte chooses:
// a ROS 1 bag, an MCAP file, or a definition (up to a zero byte) with a message of its type.
#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "config/config_error.h"
#include "roadfix/import/ros_topic.h"
#include "roadfix/rosbag/bag.h"

namespace {

using Bytes = std::span<const uint8_t>;
using namespace roadfix;

void read(Bag& bag) {
  std::vector<RosTopic> topics;
  std::vector<std::pair<BagPlace, std::vector<uint8_t>>> some;
  bag.read([&](const BagMessage& message) {
    while (topics.size() <= message.topic) topics.emplace_back(bag.topics().at(topics.size()), "fuzz.bag");
    topics.at(message.topic).take(message);
    if (some.size() < 3)
      some.emplace_back(message.place, std::vector<uint8_t>{message.data.begin(), message.data.end()});
  });
  for (const auto& [place, data] : some) {
    if (bag.data_at(place) != data) throw std::logic_error("a message reads otherwise the second time");
  }
}

void decode(Bytes bytes, RosType::Encoding encoding) {
  const auto end = std::find(bytes.begin(), bytes.end(), uint8_t{0});
  const std::string definition(bytes.begin(), end);
  const Bytes message = end == bytes.end() ? Bytes{} : Bytes(end + 1, bytes.end());
  try {
    const RosType type("fuzz/Type", definition, encoding);
    RosRecord record;
    type.decode(message, record);
    type.decode(message, record);
  } catch (const RosError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const Bytes rest(data + 1, size - 1);
  try {
    switch (data[0]) {
      case 'b':
        read(*open_ros1_bag(rest, "fuzz.bag"));
        break;
      case 'm':
        read(*open_mcap_bag(rest, "fuzz.bag"));
        break;
      case '1':
        decode(rest, RosType::Encoding::kRos1);
        break;
      default:
        decode(rest, RosType::Encoding::kCdr);
        break;
    }
  } catch (const ConfigError& e) {
    if (std::string(e.what()).find("fuzz.bag") == std::string::npos) throw std::logic_error("an error without a file");
  }
  return 0;
}
