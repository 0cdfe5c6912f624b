/// Messages of the fusion's process to and from lib/fusion: units and enums, nothing else.
#pragma once

#include <roadfix/aiding_t.hpp>
#include <roadfix/fusion_state_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/vo_restart_t.hpp>
#include <roadfix/vo_status_t.hpp>

#include "fusion/fusion.h"

namespace roadfix {

/// Everything but the count of resets, which is the caller's.
ChannelSample channel_sample(FusionChannel channel, const pose_t& message, int64_t seq);
CommonError common_error(const vo_status_t& message);
/// Nothing where the vision does not tell it.
std::optional<PassingError> passing_error(const vo_status_t& message);
Geodetic anchor_of(const pose_t& message);

/// Pose, validity, state and resets; `anchor`: nothing before the first ENU pose.
void fill_fused_pose(const Odometry& pose, const FusionReport& report, const std::optional<Geodetic>& anchor,
                     pose_t& m);
void fill_local_pose(const Odometry& pose, const FusionReport& report, pose_t& m);
fusion_state_t fusion_state(const Fusion& fusion);
aiding_t aiding(const ChannelSample& sample, const FusionChannelReport& report);
vo_restart_t vo_restart(const VisionRestart& restart);

}  // namespace roadfix
