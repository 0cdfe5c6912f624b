#include "monitor/messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "bus/sample_codec.h"
#include "geometry/frames.h"

namespace roadfix {

namespace {

constexpr std::array<const char*, 14> kSources = {"GNSS position", "GNSS velocity",  "GNSS heading", "Wheel speed",
                                                  "No sideslip",   "Standing still", "No rotation",  "Magnetic heading",
                                                  "POSE_INS",      "POSE_VO",        "POSE_WHEEL",   "Wheel yaw rate",
                                                  "Camera tracks", "Prior pose"};

/// In the order of fusion_state2_t::HEALTH_*.
constexpr std::array<const char*, 5> kHealthWords = {"silent", "invalid", "frozen", "on trial", "contradicted"};

using Row = std::pair<const char*, const char*>;
/// The first prefix that fits.
constexpr std::array<Row, 23> kTypes = {{{"IMU", "imu_t"},
                                         {"GNSS", "gnss_t"},
                                         {"WHEELS", "wheels_t"},
                                         {"MAG", "mag_t"},
                                         {"CAMERA_", "image_t"},
                                         {"RAW_", "raw_t"},
                                         {"POSE_", "pose_t"},
                                         {"REFERENCE", "pose_t"},
                                         {"PROTECTION_", "protection_level_t"},
                                         {"INS_STATUS", "ins_status_t"},
                                         {"AIDING_", "aiding_t"},
                                         {"VO_STATUS", "vo_status_t"},
                                         {"VO_FEATURES", "vo_features2_t"},
                                         {"VO_RESTART", "vo_restart_t"},
                                         {"PRIOR_POSE", "pose_t"},
                                         {"FUSION_STATE", "fusion_state2_t"},
                                         {"HEALTH", "health_t"},
                                         {"HEARTBEAT_", "heartbeat_t"},
                                         {"LEDGER_", "ledger_t"},
                                         {"STATE_", "state_t"},
                                         {"START_", "state_t"},
                                         {"HORIZON_", "horizon_t"},
                                         {"CONFIG_", "config_t"}}};

ProcessState process_state(int8_t code) {
  switch (code) {
    case heartbeat_t::STATE_RUNNING:
      return ProcessState::kRunning;
    case heartbeat_t::STATE_NO_CLOCK:
      return ProcessState::kNoClock;
    case heartbeat_t::STATE_DEGRADED:
      return ProcessState::kDegraded;
    case heartbeat_t::STATE_STOPPING:
      return ProcessState::kStopping;
    default:
      return ProcessState::kStarting;
  }
}

}  // namespace

PoseFacts pose_facts(const pose_t& m) {
  PoseFacts facts;
  facts.odometry = odometry(m);
  if (m.frame == pose_t::FRAME_ENU) {
    facts.anchor = Geodetic{m.anchor_lat_deg * kDegree, m.anchor_lon_deg * kDegree, m.anchor_height_m};
  }
  facts.metric = m.scale == pose_t::SCALE_METRIC;
  facts.reason = m.reason;
  facts.run = m.run;
  facts.reset_counter = m.reset_counter;
  return facts;
}

HeartbeatFacts heartbeat_facts(const heartbeat_t& m) {
  HeartbeatFacts facts;
  facts.run = m.run;
  facts.state = process_state(m.state);
  facts.reason = m.state_reason;
  facts.cpu_share = m.cpu_share;
  facts.rss_bytes = m.rss_bytes;
  facts.kernel_drops = m.kernel_drops;
  for (std::size_t i = 0; i < m.input_channel.size(); ++i) {
    facts.queue_depth += m.input_queue_depth[i];
    if (m.input_queue_age_s[i] <= facts.queue_age_s) continue;
    facts.queue_age_s = m.input_queue_age_s[i];
    facts.queue_channel = m.input_channel[i];
  }
  return facts;
}

std::optional<BoundFacts> bound_facts(const protection_level_t& m) {
  if (m.num_risks <= 0) return std::nullopt;
  return BoundFacts{
      m.pose_utime, m.risk.back(), {m.along_m.back(), m.across_m.back(), m.up_m.back()}, m.usable != 0, m.reason};
}

std::string source_name(const std::string& channel, int8_t source) {
  const auto i = static_cast<uint8_t>(source);  // a negative one lies beyond the last
  const std::string name = i < kSources.size() ? kSources[i] : "Unknown source";
  const std::size_t underscore = channel.find('_');
  return name + " in " + (underscore == std::string::npos ? channel : channel.substr(underscore + 1));
}

std::vector<std::string> fusion_lines(const fusion_state2_t& m) {
  const std::string leader = m.leader.empty() ? "no channel" : m.leader;
  std::string source = "no fused pose yet";
  if (m.source == fusion_state2_t::SOURCE_INS) source = "fused pose: POSE_INS";
  if (m.source == fusion_state2_t::SOURCE_CARRIED) source = "fused pose: carried on by " + leader;
  if (m.source == fusion_state2_t::SOURCE_LITERAL) source = "fused pose: scheme of Lee et al. (2025)";
  if (!m.reason.empty()) source += "; " + m.reason;
  for (std::size_t i = 0; i < m.mode_name.size(); ++i)
    if (m.mode_name[i] == "constant_turn") source += fmt::format("; turns: {:.0f} %", 100.0 * m.mode_probability[i]);
  std::string channels;
  for (std::size_t i = 0; i < m.channel_name.size(); ++i) {
    const auto health = static_cast<uint8_t>(m.channel_health[i]);
    channels += (channels.empty() ? "" : ", ") + m.channel_name[i] + " ";
    if (m.channel_health[i] == fusion_state2_t::HEALTH_GOOD)
      channels += fmt::format("{:.0f} %", 100.0 * m.channel_weight[i]);
    else
      channels += health < kHealthWords.size() ? kHealthWords[health] : "unknown";
    if (!m.channel_contradicts[i].empty()) channels += " (contradicts " + m.channel_contradicts[i] + ")";
  }
  return {source, channels};
}

health_t health_message(const HealthReport& report) {
  health_t m{};
  m.verdict = static_cast<int8_t>(report.verdict);
  m.since_utime = report.since_us;
  m.pose_channel = report.judged_pose;
  for (const Condition& reason : report.reasons) {
    m.reason.push_back(reason.text);
    m.reason_key.push_back(reason.key);
    m.reason_verdict.push_back(static_cast<int8_t>(reason.verdict));
  }
  m.num_reasons = static_cast<int32_t>(report.reasons.size());
  for (const ChannelReport& channel : report.channels) {
    m.channel_name.push_back(channel.name);
    m.channel_rate_hz.push_back(channel.rate_hz);
    m.channel_expected_hz.push_back(channel.expected_hz.value_or(0.0));
    m.channel_jitter_s.push_back(channel.jitter_s);
    m.channel_age_s.push_back(channel.age_s);
    m.channel_latency_s.push_back(channel.latency_s);
    m.channel_lost.push_back(channel.lost);
    m.channel_undecodable.push_back(channel.undecodable);
  }
  m.num_channels = static_cast<int32_t>(report.channels.size());
  return m;
}

std::string type_of_channel(const std::string& channel) {
  for (const auto& [prefix, type] : kTypes) {
    const std::string_view name = prefix;
    if (!name.empty() && (name.ends_with('_') ? channel.starts_with(name) : channel == name)) return type;
  }
  return "";
}

std::string pose_of_protection(const std::string& channel) {
  return "POSE_" + channel.substr(std::string("PROTECTION_").size());
}

std::string process_of_channel(const std::string& channel) {
  std::string name = channel.substr(std::string("HEARTBEAT_").size());
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name;
}

}  // namespace roadfix
