/// One frame of the dashboard as JSON: everything that the page shows at one moment, so that a client may miss any
/// number of frames.
#pragma once

#include <optional>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_status_t.hpp>
#include <string>
#include <vector>

#include "health/health.h"

namespace roadfix {

struct FrameMark {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();  ///< east, north, m
  double yaw = 0.0;                             ///< rad, counterclockwise from east
  HorizontalEllipse sigma;
  bool pinned = false;  ///< a frame of its own, laid on the map where it began
};

struct FramePose {
  PoseReport report;
  double age_s = 0.0;
  std::optional<FrameMark> on_map;
  std::optional<Eigen::Vector2d> error;  ///< m horizontal, rad, against the reference
};

struct FrameParts {
  explicit FrameParts(const HealthReport& health) : report(health) {}

  const HealthReport& report;
  std::vector<FramePose> poses;
  std::optional<FrameMark> reference;
  std::optional<Eigen::Vector2d> fix;  ///< of the newest GNSS fix: east, north of the antenna, m
  const fusion_state2_t* fusion = nullptr;
  const vo_status_t* vo_status = nullptr;
  const vo_features2_t* features = nullptr;
  const ins_status_t* ins_status = nullptr;
  const gnss_t* gnss = nullptr;
  int64_t picture_utime = 0;  ///< of the newest picture; 0: none
};

std::string frame_json(const FrameParts& parts);

}  // namespace roadfix
