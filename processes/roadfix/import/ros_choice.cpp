#include "roadfix/import/ros_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "config/config_error.h"

namespace roadfix {
namespace {

using Words = std::vector<const char*>;

bool has_any(const std::string& name, const Words& words) {
  std::string lower = name;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::any_of(words.begin(), words.end(), [&](const char* w) { return lower.find(w) != std::string::npos; });
}

/// How a role's topics are recognised.
struct Role {
  std::string name;
  std::set<RosKind> kinds;
  Words any;     ///< where not empty, the name must have one of them
  Words none;    ///< and none of these
  Words rather;  ///< of several, rather one with such a word
};

const Words kReceiver = {"gps", "gnss", "navsat", "ublox", "fix_vel", "novatel", "septentrio"};
const Words kRight = {"right", "cam1", "cam_1", "camera1", "camera_1", "image_1", "image_01", "image_3", "image_03"};
const Words kTruth = {"truth", "reference", "/gt", "_gt", "vicon", "optitrack", "leica", "mocap"};

const std::vector<Role>& roles() {
  using K = RosKind;
  static const std::vector<Role> all = {
      {"imu", {K::kImu}, {}, {}, {"data_raw", "raw"}},
      {"gnss",
       {K::kNavPvt, K::kGpsFix, K::kNavSatFix, K::kGpsRaw},
       {},
       {"filtered", "fused", "position/global"},
       {"fix"}},
      {"gnss_velocity", {K::kTwist}, kReceiver, {"cmd_vel", "filtered", "fused"}, {}},
      {"wheels",
       {K::kTwist},
       {},
       {"gps", "gnss", "navsat", "ublox", "fix_vel", "novatel", "septentrio", "cmd", "truth", "imu", "vicon"},
       {"wheel", "vehicle", "speed", "can", "encoder"}},
      {"wheels",
       {K::kOdometry},
       {"wheel", "vehicle", "encoder", "can/", "odom"},
       {"gps", "gnss", "truth", "reference", "filtered", "visual", "vio", "lidar", "_gt"},
       {"wheel"}},
      {"mag", {K::kMag}, {}, {}, {}},
      {"camera_right", {K::kCompressedImage, K::kImage}, kRight, {"depth", "mask", "thermal"}, {"raw", "rect"}},
      {"camera_left", {K::kCompressedImage, K::kImage}, {}, {"depth", "mask", "thermal"}, {"left", "cam0", "image_0"}},
      {"reference", {K::kOdometry, K::kPose}, kTruth, {}, {}},
      {"camera_info_left", {K::kCameraInfo}, {"\n"}, {}, {}},  // found beside the pictures, or named
      {"camera_info_right", {K::kCameraInfo}, {"\n"}, {}, {}},
  };
  return all;
}

std::string listed(const std::vector<RosTopic>& topics) {
  std::string text;
  for (const RosTopic& topic : topics) {
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", topic.topic().name, topic.topic().type);
  }
  return text;
}

/// CameraInfo lies beside the pictures: /cam0/image_raw/compressed has /cam0/camera_info.
const RosTopic* camera_info_of(const RosTopic& pictures, const std::vector<RosTopic>& topics) {
  std::string name = pictures.topic().name;
  while (name.find('/') != std::string::npos) {
    name.erase(name.rfind('/'));
    for (const RosTopic& topic : topics) {
      if (topic.kind() == RosKind::kCameraInfo && topic.topic().name == name + "/camera_info") return &topic;
    }
  }
  return nullptr;
}

class Chooser {
 public:
  Chooser(const std::vector<RosTopic>& topics, const std::string& bag) : topics_(topics), bag_(bag) {}

  void take_named(const std::string& role, const std::string& name) {
    const auto found =
        std::find_if(topics_.begin(), topics_.end(), [&](const RosTopic& t) { return t.topic().name == name; });
    if (found == topics_.end()) {
      throw ConfigError(
          bag_, 0, fmt::format("--topic {}={}: there is no such topic; there are {}", role, name, listed(topics_)));
    }
    const bool fits = std::any_of(roles().begin(), roles().end(), [&](const Role& one) {
      return one.name == role && one.kinds.contains(found->kind());
    });
    if (!fits) {
      throw ConfigError(bag_, 0,
                        fmt::format("--topic {}={}: its type {} cannot be that", role, name, found->topic().type));
    }
    set(role, *found);
  }

  void take_by_type() {
    for (const Role& role : roles()) {
      if (choice_.by_role.contains(role.name)) continue;
      if (const RosTopic* best = best_of(role)) set(role.name, *best);
    }
    if (!choice_.by_role.contains("camera_left") &&
        choice_.by_role.contains("camera_right")) {  // one eye is the left one
      choice_.by_role["camera_left"] = choice_.by_role["camera_right"];
      choice_.by_role.erase("camera_right");
    }
    for (const char* side : {"left", "right"}) {
      const std::string info = fmt::format("camera_info_{}", side);
      const RosTopic* pictures = choice_.find(fmt::format("camera_{}", side));
      if (pictures == nullptr || choice_.by_role.contains(info)) continue;
      if (const RosTopic* found = camera_info_of(*pictures, topics_)) set(info, *found);
    }
  }

  RosChoice take() {
    for (const auto& [role, topic] : choice_.by_role) {
      choice_.remarks.push_back(
          fmt::format("{} is {} ({}, {} messages)", role, topic->topic().name, topic->topic().type, topic->messages));
    }
    for (const RosTopic& topic : topics_) {
      if (taken_.contains(&topic) || topic.kind() == RosKind::kStaticTransforms) continue;
      const std::string role = role_for(topic);
      choice_.remarks.push_back(
          fmt::format("left out: {} ({}, {} messages){}", topic.topic().name, topic.topic().type, topic.messages,
                      role.empty() ? "" : fmt::format("; --topic {}={} takes it", role, topic.topic().name)));
    }
    return std::move(choice_);
  }

 private:
  void set(const std::string& role, const RosTopic& topic) {
    choice_.by_role[role] = &topic;
    taken_.insert(&topic);
  }

  /// The one with the words that the role has rather; of these the one with most messages, then the first by name.
  const RosTopic* best_of(const Role& role) const {
    const RosTopic* best = nullptr;
    const auto rank = [&](const RosTopic& topic) {
      return std::make_pair(has_any(topic.topic().name, role.rather), topic.messages);
    };
    for (const RosTopic& topic : topics_) {
      const std::string& name = topic.topic().name;
      const bool fits = role.kinds.contains(topic.kind()) && topic.messages > 0 && !taken_.contains(&topic) &&
                        (role.any.empty() || has_any(name, role.any)) && !has_any(name, role.none);
      if (!fits) continue;
      const bool better =
          best == nullptr || rank(topic) > rank(*best) || (rank(topic) == rank(*best) && name < best->topic().name);
      if (better) best = &topic;
    }
    return best;
  }

  static std::string role_for(const RosTopic& topic) {
    for (const Role& role : roles()) {
      if (role.kinds.contains(topic.kind())) return role.name;
    }
    return "";
  }

  const std::vector<RosTopic>& topics_;
  std::string bag_;
  RosChoice choice_;
  std::set<const RosTopic*> taken_;
};

}  // namespace

const std::vector<std::string>& ros_roles() {
  static const std::vector<std::string> names = {"imu",
                                                 "gnss",
                                                 "gnss_velocity",
                                                 "wheels",
                                                 "mag",
                                                 "camera_left",
                                                 "camera_right",
                                                 "camera_info_left",
                                                 "camera_info_right",
                                                 "reference"};
  return names;
}

const RosTopic* RosChoice::find(const std::string& role) const {
  const auto found = by_role.find(role);
  return found == by_role.end() ? nullptr : found->second;
}

RosChoice choose_topics(const std::vector<RosTopic>& topics, const std::map<std::string, std::string>& named,
                        const std::string& bag) {
  Chooser chooser(topics, bag);
  for (const auto& [role, name] : named) chooser.take_named(role, name);
  chooser.take_by_type();
  return chooser.take();
}

}  // namespace roadfix
