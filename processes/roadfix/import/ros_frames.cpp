#include "roadfix/import/ros_frames.h"

#include <map>
#include <queue>

namespace roadfix {
namespace {

/// ROS 1 wrote frames with a leading slash now and then.
std::string plain(const std::string& frame) { return frame.starts_with('/') ? frame.substr(1) : frame; }

}  // namespace

RosFrames::RosFrames(const std::vector<RosTopic>& topics) {
  for (const RosTopic& topic : topics) {
    for (const RosTransform& t : topic.transforms)
      edges_.push_back({plain(t.parent), plain(t.child), t.T_parent_child});
  }
}

std::optional<SE3> RosFrames::find(const std::string& a, const std::string& b) const {
  const std::string to = plain(b);
  std::map<std::string, SE3> T_a = {{plain(a), SE3{}}};
  std::queue<std::string> open;
  open.push(plain(a));
  while (!open.empty()) {
    const std::string frame = open.front();
    open.pop();
    if (frame == to) return T_a[frame];
    for (const RosTransform& edge : edges_) {
      if (edge.parent == frame && T_a.try_emplace(edge.child, T_a[frame] * edge.T_parent_child).second)
        open.push(edge.child);
      if (edge.child == frame && T_a.try_emplace(edge.parent, T_a[frame] * edge.T_parent_child.inverse()).second) {
        open.push(edge.parent);
      }
    }
  }
  return std::nullopt;
}

std::string RosFrames::base() const {
  for (const char* name : {"base_link", "base_footprint", "base", "vehicle"}) {
    for (const RosTransform& edge : edges_) {
      if (edge.parent == name || edge.child == name) return name;
    }
  }
  return "";
}

}  // namespace roadfix
