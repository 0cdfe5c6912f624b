/// Messages to what lib/health takes, and its report to HEALTH.
#pragma once

#include <optional>
#include <roadfix/aiding_t.hpp>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/health_t.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/protection_level_t.hpp>
#include <string>
#include <vector>

#include "health/health.h"

namespace roadfix {

PoseFacts pose_facts(const pose_t& message);
HeartbeatFacts heartbeat_facts(const heartbeat_t& message);
/// Nothing where it has no level.
std::optional<BoundFacts> bound_facts(const protection_level_t& message);

/// "GNSS position in INS": the source and whose estimate it went into.
std::string source_name(const std::string& channel, int8_t source);

/// What POSE_FUSED is and why, then weight or health of each channel and whom it contradicts: lines for a page.
std::vector<std::string> fusion_lines(const fusion_state2_t& message);

/// utime, run and seq are the caller's.
health_t health_message(const HealthReport& report);

/// The type that a channel of ours carries; empty for a channel that is not ours.
std::string type_of_channel(const std::string& channel);

/// POSE_FUSED of PROTECTION_FUSED.
std::string pose_of_protection(const std::string& channel);

/// gnss_ins_ekf of HEARTBEAT_GNSS_INS_EKF.
std::string process_of_channel(const std::string& channel);

}  // namespace roadfix
