/// The frames of /tf_static, and where sensors sit by them.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "roadfix/import/ros_topic.h"

namespace roadfix {

class RosFrames {
 public:
  explicit RosFrames(const std::vector<RosTopic>& topics);

  /// Takes coordinates of `b` to `a`; nothing where no chain of transforms leads from one to the other.
  [[nodiscard]] std::optional<SE3> find(const std::string& a, const std::string& b) const;
  /// The vehicle's own frame: base_link and its like, x forward, y left, z up (REP 105); "" where there is none.
  [[nodiscard]] std::string base() const;
  [[nodiscard]] bool empty() const { return edges_.empty(); }

 private:
  std::vector<RosTransform> edges_;
};

}  // namespace roadfix
