#include "monitor/handler.h"

#include <algorithm>
#include <cmath>
#include <roadfix/gnss_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/sample_codec.h"
#include "bus/types/message.h"
#include "geometry/frames.h"
#include "monitor/messages.h"
#include "stream/digest.h"

namespace roadfix {

namespace {

/// Forged names must not fill the memory: what comes after so many is not looked at.
constexpr std::size_t kMaxChannels = 256;
/// Fingerprint, utime, run and seq: what differs in every message.
constexpr std::size_t kHeadBytes = 32;

bool usable(const std::string& type, std::span<const uint8_t> bytes) {
  if (type == "imu_t") {
    const ImuSample sample = imu_sample(decode<imu_t>(bytes));
    return sample.gyro.allFinite() && sample.accel.allFinite();
  }
  if (type == "mag_t") return mag_sample(decode<mag_t>(bytes)).field.allFinite();
  if (type == "wheels_t") {
    const WheelSample sample = wheel_sample(decode<wheels_t>(bytes));
    return std::all_of(sample.speeds.begin(), sample.speeds.begin() + sample.num_speeds,
                       [](double speed) { return std::isfinite(speed); });
  }
  if (type == "gnss_t") {
    const auto m = decode<gnss_t>(bytes);
    return m.fix_type == gnss_t::FIX_NONE ||
           (std::abs(m.lat_deg) <= 90.0 && std::abs(m.lon_deg) <= 180.0 && std::isfinite(m.height_m));
  }
  return true;
}

/// Only of sensors whose noise makes every sample another one: a standing car's wheels repeat themselves rightly.
std::optional<uint64_t> content(const std::string& type, std::span<const uint8_t> bytes) {
  if (type != "imu_t" && type != "mag_t" && type != "image_t") return std::nullopt;
  return chain_digest(0, bytes.subspan(kHeadBytes));
}

}  // namespace

MonitorHandler::Channel* MonitorHandler::channel(const std::string& name) {
  const auto known = channels_.find(name);
  if (known != channels_.end()) return &known->second;
  if (channels_.size() >= kMaxChannels) return nullptr;
  Channel channel;
  channel.type = type_of_channel(name);
  if (!channel.type.empty()) channel.check = Schema::built_in().check_of(channel.type);
  return &channels_.emplace(name, std::move(channel)).first->second;
}

void MonitorHandler::take(const BusMessage& message, int64_t now_us) {
  advance(now_us);
  const std::string name(message.channel);
  Channel* known = channel(name);
  if (known == nullptr || !known->check || name == "HEALTH") return;
  if (const CheckResult result = (*known->check)(message.bytes); result != CheckResult::kOk) {
    health_.undecodable(name, now_us_, to_words(result));
    return;
  }
  const Header header = *read_header(message.bytes);
  if (!is_plausible(header)) {
    health_.undecodable(name, now_us_, "a time or number that cannot be");
    return;
  }
  health_.arrived(
      name, {now_us_, header.utime, header.run, header.seq, message.bytes.size(), content(known->type, message.bytes)});
  if (!usable(known->type, message.bytes)) {
    health_.unusable(name, now_us_);
    return;
  }
  translate(name, known->type, message.bytes);
  for (MonitorListener* listener : listeners_) listener->message(name, known->type, message, now_us_);
}

void MonitorHandler::translate(const std::string& channel, const std::string& type, std::span<const uint8_t> bytes) {
  if (type == "pose_t" && channel != "REFERENCE") {
    health_.pose(channel, now_us_, pose_facts(decode<pose_t>(bytes)));
  } else if (type == "protection_level_t") {
    if (const auto bound = bound_facts(decode<protection_level_t>(bytes)))
      health_.bound(pose_of_protection(channel), *bound);
  } else if (type == "heartbeat_t") {
    health_.heartbeat(process_of_channel(channel), now_us_, heartbeat_facts(decode<heartbeat_t>(bytes)));
  } else if (type == "aiding_t") {
    const auto m = decode<aiding_t>(bytes);
    const bool accepted = m.status == aiding_t::STATUS_ACCEPTED;
    if (accepted || m.status == aiding_t::STATUS_GATED) {
      health_.measurement(source_name(channel, m.source), now_us_, m.nis, m.dof, accepted);
    }
  }
}

void MonitorHandler::advance(int64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  while (const std::optional<int64_t> due = health_.next_decision(now_us_)) {
    const bool changed = health_.decide(*due);
    if (listeners_.empty()) continue;
    const HealthReport report = health_.report();
    for (MonitorListener* listener : listeners_) listener->decided(report, changed);
  }
}

}  // namespace roadfix
