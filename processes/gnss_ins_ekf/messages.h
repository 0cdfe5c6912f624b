/// Messages of the GNSS/INS process to and from lib/navigation: units and enums, nothing else.
#pragma once

#include <roadfix/aiding_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/pose_t.hpp>

#include "navigation/navigation.h"

namespace roadfix {

GnssFix gnss_fix(const gnss_t& message);
/// Of a pose in enu whose origin is the imu; any other becomes one that claims nothing, which the filter refuses.
PriorPose prior_pose(const pose_t& message);
void fill_ins_pose(const navigation::NavigationOutput& output, const std::optional<Geodetic>& anchor, pose_t& pose);
/// q_vehicle_body: by which samples and facts were turned before the filter got them.
ins_status_t ins_status(const navigation::NavigationStatus& status, const navigation::Filter* filter,
                        const navigation::VehicleFacts& vehicle, const Eigen::Quaterniond& q_vehicle_body);
aiding_t aiding(const navigation::AidingRecord& record);

}  // namespace roadfix
