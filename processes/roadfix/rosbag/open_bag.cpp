// Which reader a bag needs, and rosbag2's folders of several files.
#include <fmt/format.h>

#include <algorithm>

#include "config/config_error.h"
#include "config/scalar.h"
#include "config/yaml_node.h"
#include "roadfix/rosbag/bag.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMetadata = "metadata.yaml";

/// The files that metadata.yaml lists, one behind the other, and its count of messages.
class BagFolder : public Bag {
 public:
  explicit BagFolder(const fs::path& folder) : metadata_((folder / kMetadata).string()) {
    const YamlNode root = parse_yaml_tree(read_text_file(metadata_), metadata_);
    const YamlNode* info = root.find("rosbag2_bagfile_information");
    const YamlNode* files = info == nullptr ? nullptr : info->find("relative_file_paths");
    if (files == nullptr || files->kind != YamlNode::Kind::kList || files->items.empty()) {
      throw ConfigError(metadata_, 0, "rosbag2_bagfile_information.relative_file_paths is missing");
    }
    const YamlNode* mode = info->find("compression_mode");
    if (mode != nullptr && !mode->scalar.empty() && mode->scalar != "NONE") {
      throw ConfigError(
          metadata_, mode->line,
          fmt::format("compression_mode = {}: unpack it first (`ros2 bag convert`, or zstd -d)", mode->scalar));
    }
    for (const YamlNode& file : files->items) {
      const fs::path path = folder / fs::path(file.scalar).filename();  // older versions put the folder before it
      bags_.push_back(open_bag(path));
    }
    if (const YamlNode* count = info->find("message_count")) {
      const auto number = parse_integer(count->scalar);
      if (!number)
        throw ConfigError(metadata_, count->line, fmt::format("message_count = {}: is no number", count->scalar));
      declared_ = *number;
    }
  }

  void read(const Visitor& visitor) override {
    int64_t found = 0;
    for (std::size_t file = 0; file < bags_.size(); ++file) {
      std::vector<std::size_t> indices;
      bags_[file]->read([&](BagMessage message) {
        while (indices.size() <= message.topic) indices.push_back(topic_index(bags_[file]->topics()[indices.size()]));
        message.topic = indices[message.topic];
        message.place.file = file;
        ++found;
        visitor(message);
      });
    }
    if (declared_ >= 0 && found < declared_) {
      throw ConfigError(metadata_, 0,
                        fmt::format("tells {} messages, the files have {}: they are cut short", declared_, found));
    }
  }

  std::vector<uint8_t> data_at(const BagPlace& place) override {
    return bags_.at(place.file)->data_at({0, place.chunk, place.record});
  }

 private:
  std::string metadata_;
  std::vector<std::unique_ptr<Bag>> bags_;
  int64_t declared_ = -1;
};

}  // namespace

std::size_t Bag::topic_index(BagTopic topic) {
  const auto found = std::find_if(topics_.begin(), topics_.end(), [&](const BagTopic& one) {
    return one.name == topic.name && one.type == topic.type;
  });
  if (found != topics_.end()) return static_cast<std::size_t>(found - topics_.begin());
  topics_.push_back(std::move(topic));
  return topics_.size() - 1;
}

bool is_bag(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    if (!fs::is_regular_file(path / kMetadata, ignored)) return false;
    try {
      return read_text_file(path / kMetadata).find("rosbag2_bagfile_information") != std::string::npos;
    } catch (const ConfigError&) {
      return false;
    }
  }
  const fs::path ending = path.extension();
  return fs::is_regular_file(path, ignored) && (ending == ".bag" || ending == ".mcap" || ending == ".db3");
}

std::unique_ptr<Bag> open_bag(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return std::make_unique<BagFolder>(path);
  if (!fs::is_regular_file(path, ignored)) throw ConfigError(path.string(), 0, "no such file");
  const fs::path ending = path.extension();
  if (ending == ".bag") return open_ros1_bag(path);
  if (ending == ".mcap") return open_mcap_bag(path);
  if (ending == ".db3") return open_sqlite_bag(path);
  if (ending == ".zstd")
    throw ConfigError(path.string(), 0,
                      "is packed: unpack it first (zstd -d), and name the file without .zstd in metadata.yaml");
  throw ConfigError(path.string(), 0, "is no bag: .bag (ROS 1), .mcap, .db3, or a folder with metadata.yaml");
}

}  // namespace roadfix
