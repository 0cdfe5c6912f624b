#include "roadfix/evaluate/evaluation_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "bus/log/log_survey.h"
#include "bus/log/stray_stamps.h"
#include "bus/types/message.h"
#include "bus/types/schema.h"
#include "config/config.h"
#include "geodesy/enu_change.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/aiding_t.hpp"
#include "roadfix/config_t.hpp"
#include "roadfix/ins_status_t.hpp"
#include "roadfix/protection_level_t.hpp"

namespace roadfix {
namespace {

constexpr const char* kReferenceChannel = "REFERENCE";

Validity validity_of(int8_t value) {
  if (value == pose_t::VALIDITY_VALID) return Validity::kValid;
  return value == pose_t::VALIDITY_COASTING ? Validity::kCoasting : Validity::kInvalid;
}

Odometry odometry_of(const pose_t& m) {
  Odometry pose;
  pose.t_us = m.utime;
  pose.T_frame_vehicle.p = Eigen::Map<const Eigen::Vector3d>(m.position_m);
  pose.T_frame_vehicle.q = Eigen::Quaterniond(m.q_wxyz[0], m.q_wxyz[1], m.q_wxyz[2], m.q_wxyz[3]).normalized();
  pose.velocity = Eigen::Map<const Eigen::Vector3d>(m.velocity_mps);
  pose.angular_rate = Eigen::Map<const Eigen::Vector3d>(m.angular_rate_radps);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) pose.cov_pose(i, j) = m.cov_pose_m2_rad2[i][j];
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose.cov_velocity(i, j) = m.cov_velocity_m2ps2[i][j];
  }
  pose.validity = validity_of(m.validity);
  return pose;
}

bool finite(const Odometry& pose) {
  return pose.T_frame_vehicle.p.allFinite() && pose.T_frame_vehicle.q.coeffs().allFinite();
}

void transform(const SE3& T, Odometry& pose) { pose = transformed({1.0, T}, pose); }

/// Collects one channel; poses of a frame other than the last one's are dropped when it is done. Poses that are invalid
/// before the first other one have no place, and often no anchor yet: they set none, and stay as they are.
class StreamBuilder {
 public:
  void add(const pose_t& m, int64_t log_time_us) {
    Odometry pose = odometry_of(m);
    if (!finite(pose)) pose.validity = Validity::kInvalid;
    const bool local_frame = m.frame == pose_t::FRAME_LOCAL;
    if (!local_frame)
      to_first_anchor({m.anchor_lat_deg * kDegree, m.anchor_lon_deg * kDegree, m.anchor_height_m}, pose);
    stream_.scale_unknown = m.scale == pose_t::SCALE_UNKNOWN;
    stream_.local_frame = local_frame;
    stream_.origin = m.origin;
    if (!stream_.trajectory.poses.empty() && pose.t_us <= stream_.trajectory.poses.back().t_us) {
      ++stream_.backward;
      return;
    }
    stream_.trajectory.poses.push_back(pose);
    stream_.reasons.push_back(m.reason);
    stream_.latencies.push_back(static_cast<double>(log_time_us - m.utime) * 1e-6);
    local_.push_back(local_frame);
  }

  PoseStream take() {
    auto& poses = stream_.trajectory.poses;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      if (local_[i] != stream_.local_frame) continue;
      poses[kept] = poses[i];
      stream_.reasons[kept] = stream_.reasons[i];
      stream_.latencies[kept++] = stream_.latencies[i];
    }
    stream_.other_frame = static_cast<int>(poses.size() - kept);
    poses.resize(kept);
    stream_.reasons.resize(kept);
    stream_.latencies.resize(kept);
    if (!stream_.anchor && !stream_.local_frame) stream_.anchor = last_anchor_;  // all are invalid
    // A replay stamps each event with its message's own time: there is no latency to measure.
    if (std::all_of(stream_.latencies.begin(), stream_.latencies.end(), [](double l) { return l == 0.0; })) {
      stream_.latencies.clear();
    }
    return std::move(stream_);
  }

 private:
  void to_first_anchor(const Geodetic& anchor, Odometry& pose) {
    if (!stream_.anchor && pose.validity == Validity::kInvalid) {
      last_anchor_ = anchor;
      return;
    }
    if (!stream_.anchor) stream_.anchor = last_anchor_ = anchor;
    if (same_anchor(anchor, *stream_.anchor)) return;
    if (!same_anchor(anchor, last_anchor_)) T_first_last_ = T_enu_enu(*stream_.anchor, last_anchor_ = anchor);
    transform(T_first_last_, pose);
  }

  PoseStream stream_;
  std::vector<bool> local_;
  Geodetic last_anchor_;
  SE3 T_first_last_;
};

void read_facts(const config_t& config, const std::filesystem::path& path, EvaluationLog& log) {
  log.facts = parse_config<DriveFacts>(config.config_yaml, path.string() + " (CONFIG_DRIVE)");
  if (!config.calibration_yaml.empty()) {
    log.calibration = parse_calibration(config.calibration_yaml, path.string() + " (CONFIG_DRIVE calibration)");
  }
  log.has_facts = true;
}

constexpr std::string_view kProtection = "PROTECTION_";

ProtectionSample protection_of(const protection_level_t& m) {
  ProtectionSample sample{m.pose_utime, m.risk, {}, {m.alert_along_m, m.alert_across_m, m.alert_up_m}, m.usable != 0};
  for (std::size_t r = 0; r < m.risk.size(); ++r) sample.level.emplace_back(m.along_m[r], m.across_m[r], m.up_m[r]);
  return sample;
}
constexpr const char* kAidingChannel = "AIDING_INS";
constexpr const char* kStatusChannel = "INS_STATUS";

/// The checks of the types that are read here.
struct Checks {
  MessageCheck pose = Schema::built_in().check_of("pose_t");
  MessageCheck config = Schema::built_in().check_of("config_t");
  MessageCheck fusion = Schema::built_in().check_of("fusion_state2_t");
  MessageCheck protection = Schema::built_in().check_of("protection_level_t");
  MessageCheck aiding = Schema::built_in().check_of("aiding_t");
  MessageCheck status = Schema::built_in().check_of("ins_status_t");
};

/// Collects what a log holds: add() takes note of an event and says whether it is a message of its channel's type;
/// take() reads them in the order of their own time, whatever the order in the file.
class LogCollector {
 public:
  LogCollector(const LogReader& reader, const std::set<std::string>& channels) : reader_(reader), channels_(channels) {}

  bool add(const LogEvent& event) {
    const std::string channel(event.channel);
    const bool config = channel == "CONFIG_DRIVE";
    const bool fusion = channel == "FUSION_STATE";
    if (channel == kReferenceChannel || channel.starts_with("POSE_")) log_.pose_channels.insert(channel);
    const bool protection = channel.starts_with(kProtection);
    const bool aiding = channel == kAidingChannel;
    const bool status = channel == kStatusChannel;
    if (!is_pose(channel) && !config && !fusion && !protection && !aiding && !status) return true;
    const MessageCheck& check = config       ? checks_.config
                                : fusion     ? checks_.fusion
                                : protection ? checks_.protection
                                : aiding     ? checks_.aiding
                                : status     ? checks_.status
                                             : checks_.pose;
    if (check(event.data) != CheckResult::kOk) return false;
    const Header header = *read_header(event.data);
    Noted& noted = noted_[channel];
    noted.stamps.push_back({header.run, header.seq, header.utime});
    noted.offsets.push_back(event.offset);
    return true;
  }

  EvaluationLog take() {
    for (auto& [channel, noted] : noted_) {
      const std::vector<std::size_t> order = in_order(channel, noted);
      StreamBuilder builder;
      for (const std::size_t i : order) {
        const LogEvent event = reader_.at(noted.offsets[i]);
        if (channel == "CONFIG_DRIVE") {
          read_facts(decode<config_t>(event.data), reader_.path(), log_);
        } else if (channel == "FUSION_STATE") {
          append(decode<fusion_state2_t>(event.data), log_.fusion);
        } else if (channel.starts_with(kProtection)) {
          log_.protection["POSE_" + channel.substr(kProtection.size())].push_back(
              protection_of(decode<protection_level_t>(event.data)));
        } else if (channel == kStatusChannel) {
          log_.mounting.add(decode<ins_status_t>(event.data));
        } else if (channel == kAidingChannel) {
          const aiding_t aiding = decode<aiding_t>(event.data);
          if (aiding.source == aiding_t::SOURCE_GNSS_POSITION && aiding.status == aiding_t::STATUS_ACCEPTED)
            log_.accepted_fixes_us.push_back(aiding.measurement_utime);
        } else {
          builder.add(decode<pose_t>(event.data), event.timestamp_us);
        }
      }
      if (is_pose(channel)) log_.poses.emplace(channel, builder.take());
    }
    find_outages();
    return std::move(log_);
  }

 private:
  /// Of a drive from which no tool has cut any.
  void find_outages() {
    if (!log_.facts.outages.empty()) return;
    std::sort(log_.accepted_fixes_us.begin(), log_.accepted_fixes_us.end());
    log_.facts.outages = outages_between(log_.accepted_fixes_us);
    if (log_.facts.outages.empty()) return;
    log_.notes.push_back(fmt::format("{} outages were found: no fix was accepted for more than {} s",
                                     log_.facts.outages.size(), kLeastOutage));
  }

  struct Noted {
    std::vector<Stamp> stamps;
    std::vector<uint64_t> offsets;
  };

  [[nodiscard]] bool is_pose(const std::string& channel) const {
    if (channel == kReferenceChannel) return true;
    if (channel == "CONFIG_DRIVE" || channel == "FUSION_STATE" || channel == kAidingChannel ||
        channel == kStatusChannel)
      return false;
    return channels_.empty() ? channel.starts_with("POSE_") : channels_.contains(channel);
  }

  /// By time, then as they were numbered. One stray stamp would reach over the whole time that is scored.
  std::vector<std::size_t> in_order(const std::string& channel, const Noted& noted) {
    const std::vector<StampError> errors = stray_stamps(noted.stamps);
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      if (errors[i] == StampError::kNone) order.push_back(i);
    }
    if (const std::size_t stray = errors.size() - order.size(); stray > 0) {
      log_.notes.push_back(
          fmt::format("{}: {} messages whose stamps contradict the others are left out", channel, stray));
    }
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      const Stamp& x = noted.stamps[a];
      const Stamp& y = noted.stamps[b];
      return std::tie(x.utime, x.run, x.seq) < std::tie(y.utime, y.run, y.seq);
    });
    return order;
  }

  const LogReader& reader_;
  const std::set<std::string>& channels_;
  Checks checks_;
  EvaluationLog log_;
  std::map<std::string, Noted> noted_;
};

/// The point of the vehicle in body axes, where the calibration has it.
std::optional<Eigen::Vector3d> point_of(int8_t origin, const Calibration& calibration) {
  const bool imu_body = calibration.body_origin.value_or(BodyOrigin::kImu) == BodyOrigin::kImu;
  if (origin == pose_t::ORIGIN_IMU && imu_body) return Eigen::Vector3d::Zero();
  if (origin == pose_t::ORIGIN_REAR_AXLE && !imu_body) return Eigen::Vector3d::Zero();
  if (origin == pose_t::ORIGIN_ANTENNA && calibration.sensors.gnss) return calibration.sensors.gnss->lever_arm;
  if (origin == pose_t::ORIGIN_CAMERA && calibration.sensors.camera_left && calibration.sensors.camera_left->mounting) {
    return calibration.sensors.camera_left->mounting->p;
  }
  return std::nullopt;
}

const char* origin_name(int8_t origin) {
  static constexpr const char* kNames[] = {"imu", "rear axle", "antenna", "camera"};
  return origin >= 0 && origin < 4 ? kNames[origin] : "unknown point";
}

}  // namespace

EvaluationLog read_evaluation_log(const std::filesystem::path& path, const std::set<std::string>& channels) {
  LogReader reader(path);
  require_our_log(reader);
  LogCollector collector(reader, channels);
  int undecodable = 0;
  while (const auto event = reader.next()) undecodable += collector.add(*event) ? 0 : 1;
  EvaluationLog log = collector.take();
  if (undecodable > 0) {
    log.notes.push_back(fmt::format("{} messages of {} could not be decoded", undecodable, path.string()));
  }
  if (!reader.damage().empty()) {
    log.notes.push_back(
        fmt::format("{} is damaged in {} places; what is intact was used", path.string(), reader.damage().size()));
  }
  return log;
}

const PoseStream& poses_of(const EvaluationLog& log, const std::string& channel, const std::filesystem::path& path) {
  const auto found = log.poses.find(channel);
  if (found != log.poses.end()) return found->second;
  throw EvaluationLogError(fmt::format("{}: no poses on channel {} ({})", path.string(), channel,
                                       log.pose_channels.empty()
                                           ? "there are none at all"
                                           : fmt::format("there are {}", fmt::join(log.pose_channels, ", "))));
}

void move_to_anchor(PoseStream& stream, const Geodetic& anchor) {
  if (!stream.anchor || stream.local_frame || same_anchor(*stream.anchor, anchor)) return;
  const SE3 T = T_enu_enu(anchor, *stream.anchor);
  for (Odometry& pose : stream.trajectory.poses) transform(T, pose);
  stream.anchor = anchor;
}

std::string left_out(const std::string& channel, const PoseStream& stream) {
  if (stream.backward + stream.other_frame == 0) return {};
  return fmt::format("{}: {} poses for a time that has one already and {} in another frame are left out", channel,
                     stream.backward, stream.other_frame);
}

void turn_to_imu_axes(const std::string& channel, const EvaluationLog& log, const EvaluationLog& truth,
                      PoseStream& stream) {
  const bool estimated = channel == "POSE_INS" || channel == "POSE_FUSED";
  const std::optional<Eigen::Vector3d>& angles = truth.facts.reference.mounting;
  const bool known = estimated && angles;
  const MountingSeries::Mounting fixed{
      known ? quaternion({angles->z(), angles->y(), angles->x()}) : truth.calibration.q_vehicle_body(),
      Eigen::Vector3d::Zero()};
  for (Odometry& pose : stream.trajectory.poses) {
    const MountingSeries::Mounting m = estimated && !known ? log.mounting.at(pose.t_us, fixed.q_vehicle_body) : fixed;
    if (!m.q_vehicle_body.vec().isZero(0.0)) pose = in_axes(m.q_vehicle_body, pose);
    if (m.std.isZero(0.0)) continue;
    const Eigen::Matrix3d R = m.q_vehicle_body.conjugate().toRotationMatrix();
    const Eigen::Matrix3d turn = R * m.std.cwiseAbs2().asDiagonal() * R.transpose();
    pose.cov_pose.bottomRightCorner<3, 3>() += turn;
    pose.cov_velocity += skew(pose.velocity) * turn * skew(pose.velocity).transpose();
  }
}

Reference reference_of(const EvaluationLog& log, const std::filesystem::path& path) {
  const auto found = log.poses.find(kReferenceChannel);
  if (found == log.poses.end() || found->second.trajectory.poses.empty()) {
    throw EvaluationLogError(path.string() +
                             ": no poses on channel REFERENCE; give a log that has them with --reference");
  }
  Reference reference{found->second.trajectory, {}};
  reference.trajectory.has_attitude = log.facts.reference.attitude;
  reference.trajectory.has_velocity = log.facts.reference.velocity;
  for (std::size_t i = 0; i < reference.trajectory.poses.size(); ++i) {
    reference.flags.push_back({.may_score = reference.trajectory.poses[i].validity == Validity::kValid,
                               .withheld = found->second.reasons[i] == kWithheld});
  }
  return reference;
}

Eigen::Vector3d lever_arm_between(int8_t from_origin, int8_t to_origin, const Calibration& calibration,
                                  std::vector<std::string>& notes) {
  if (from_origin == to_origin) return Eigen::Vector3d::Zero();
  const auto from = point_of(from_origin, calibration);
  const auto to = point_of(to_origin, calibration);
  if (from && to) return *to - *from;
  const std::string note =
      fmt::format("the calibration does not tell where the {} is seen from the {}: compared as if they were one point",
                  origin_name(to_origin), origin_name(from_origin));
  if (std::find(notes.begin(), notes.end(), note) == notes.end()) notes.push_back(note);
  return Eigen::Vector3d::Zero();
}

}  // namespace roadfix
