/// Messages of the fusion's process to and from lib/fusion: units and enums, nothing else.
#pragma once

#include <roadfix/aiding_t.hpp>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/vo_restart_t.hpp>

#include "fusion/fusion.h"
#include "papers/literal_fusion.h"

namespace roadfix {

/// Everything but the count of resets and what a status says, which are the caller's.
ChannelSample channel_sample(FusionChannel channel, const pose_t& message, int64_t seq);
Geodetic anchor_of(const pose_t& message);

/// Pose, validity, state and resets; `anchor`: of ENU.
void fill_fused_pose(const Odometry& pose, const FusionReport& report, const std::optional<Geodetic>& anchor,
                     pose_t& m);
void fill_local_pose(const Odometry& pose, const FusionReport& report, pose_t& m);
/// `literal`: where POSE_FUSED is its pose.
fusion_state2_t fusion_state(const Fusion& fusion, const LiteralFusion* literal);
/// The literal scheme's pose in place of the default's.
void literal_pose(const LiteralFusion& literal, const Fusion& fusion, FusedPoses& poses);
aiding_t aiding(const ChannelSample& sample, const FusionChannelReport& report);
vo_restart_t vo_restart(const VisionRestart& restart);

}  // namespace roadfix
