/// A ROS bag of any kind: topics and messages in the order of the file. What is damaged or cut short is a ConfigError
/// with file and offset.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "roadfix/rosbag/ros_type.h"

namespace roadfix {

struct BagTopic {
  std::string name;
  std::string type;        ///< package/Type
  std::string definition;  ///< .msg text with its parts; may be empty
  RosType::Encoding encoding = RosType::Encoding::kRos1;
  bool readable = true;  ///< serialised as ROS does
};

/// Where a message lies, so that it can be read again.
struct BagPlace {
  std::size_t file = 0;  ///< of a bag of several
  uint64_t chunk = 0;
  uint64_t record = 0;
};

struct BagMessage {
  std::size_t topic = 0;          ///< in Bag::topics()
  int64_t time_ns = 0;            ///< when it was recorded
  std::span<const uint8_t> data;  ///< until the visitor returns
  BagPlace place;
};

class Bag {
 public:
  using Visitor = std::function<void(const BagMessage&)>;

  virtual ~Bag() = default;
  /// Every message once; topics() is complete when it returns, and has the message's topic before.
  virtual void read(const Visitor& visitor) = 0;
  /// A message that read() gave; neighbours are cheap to read one after the other.
  virtual std::vector<uint8_t> data_at(const BagPlace& place) = 0;
  [[nodiscard]] const std::vector<BagTopic>& topics() const { return topics_; }

 protected:
  std::size_t topic_index(BagTopic topic);

 private:
  std::vector<BagTopic> topics_;
};

std::unique_ptr<Bag> open_ros1_bag(const std::filesystem::path& path);
std::unique_ptr<Bag> open_ros1_bag(std::span<const uint8_t> bytes, const std::string& name);
std::unique_ptr<Bag> open_mcap_bag(const std::filesystem::path& path);
std::unique_ptr<Bag> open_mcap_bag(std::span<const uint8_t> bytes, const std::string& name);
std::unique_ptr<Bag> open_sqlite_bag(const std::filesystem::path& path);

/// A .bag, .mcap or .db3 file, or the folder of a rosbag2 with its metadata.yaml.
std::unique_ptr<Bag> open_bag(const std::filesystem::path& path);
/// Whether it looks like one of these.
bool is_bag(const std::filesystem::path& path);

}  // namespace roadfix
