/// Conversion between messages and lib/slam: units and enums only.
#pragma once

#include <roadfix/ins_status_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_restart_t.hpp>
#include <roadfix/vo_status_t.hpp>

#include "config/calibration.h"
#include "navigation/navigation.h"
#include "slam/keyframe_tracker.h"

namespace roadfix {

pose_t vo_pose(const TrackedFrame& frame, const Odometry& odometry, BodyOrigin origin);
/// The pose with all loops closed, with resets of its own.
pose_t vo_closed_pose(const TrackedFrame& frame, const Odometry& closed, BodyOrigin origin);
/// As in the configuration and in VO_STATUS.
const char* name_of(FrontEndKind kind);

/// `shared`: of the pose published beside it; the message has the columns of the scales.
vo_status_t vo_status(const TrackedFrame& frame, const ConsideredColumns& shared, FrontEndKind front_end);
/// Of mode `filter`.
vo_status_t filter_status(const navigation::NavigationOutput& output, const navigation::Navigation& filter,
                          bool two_eyes);
vo_features2_t vo_features(const TrackedFrame& frame);

void set_reset(int counter, const SE3& delta, pose_t& message);
Restart restart(const vo_restart_t& message);
/// Vehicle speed; no value where the sample has none.
std::optional<SpeedSample> wheel_speed(const WheelSample& sample, const std::optional<WheelsCalibration>& wheels);
std::optional<SpeedSample> ins_speed(const Odometry& odometry);
/// The mounting that an INS has estimated, beyond the calibration's angles, by which cameras are turned already.
struct InsMounting {
  Eigen::Quaterniond learnt = Eigen::Quaterniond::Identity();  ///< calibrated to estimated axes
  double roll_std = 0.0;                                       ///< rad, of the calibration: roll is not estimated
};
InsMounting ins_mounting(const ins_status_t& status, const Calibration& calibration);
/// Attitude of the axes that cameras are calibrated in.
std::optional<AttitudeSample> ins_level(const Odometry& odometry, const InsMounting& mounting);

}  // namespace roadfix
