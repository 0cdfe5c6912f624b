#include "integrity/handler.h"

#include <array>
#include <roadfix/aiding_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/protection_level_t.hpp>

#include "bus/run/publish_slot.h"
#include "bus/sample_codec.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "geodesy/enu_change.h"
#include "geometry/frames.h"
#include "integrity/protection.h"
#include "stream/state_bytes.h"

namespace roadfix {
namespace {

// What is known of positions and of the way comes before the poses that it bounds.
enum Input { kAiding = 0, kWheel = 1, kIns = 2, kFused = 3 };
constexpr std::size_t kBounded = 2;

int8_t code(Hypothesis hypothesis) {
  switch (hypothesis) {
    case Hypothesis::kNoFault:
      return protection_level_t::HYPOTHESIS_NO_FAULT;
    case Hypothesis::kReceiver:
      return protection_level_t::HYPOTHESIS_RECEIVER;
    case Hypothesis::kUnverified:
      return protection_level_t::HYPOTHESIS_UNVERIFIED;
    case Hypothesis::kContradiction:
      return protection_level_t::HYPOTHESIS_CONTRADICTION;
    case Hypothesis::kCoasting:
      return protection_level_t::HYPOTHESIS_COASTING;
    case Hypothesis::kNoBound:
      break;
  }
  return protection_level_t::HYPOTHESIS_NO_BOUND;
}

std::optional<PositionInnovation> position_innovation(const aiding_t& m) {
  const bool tried = m.status == aiding_t::STATUS_ACCEPTED || m.status == aiding_t::STATUS_GATED;
  if (m.source != aiding_t::SOURCE_GNSS_POSITION || !tried || m.dof < 2 || m.dof > 3) return std::nullopt;
  PositionInnovation z{m.utime, m.status == aiding_t::STATUS_ACCEPTED, m.nis, m.dof};
  for (int i = 0; i < m.dof; ++i) {
    z.innovation(i) = m.innovation[static_cast<std::size_t>(i)];
    z.variance(i) = m.innovation_variance[static_cast<std::size_t>(i)];
  }
  return z;
}

protection_level_t message_of(const Protection& p, const pose_t& pose, const IntegrityConfig& config) {
  protection_level_t m{};
  m.pose_utime = pose.utime;
  m.pose_run = pose.run;
  m.pose_seq = pose.seq;
  m.num_risks = kRisks;
  m.risk = {config.frequent_risk, config.rare_risk};
  for (const Eigen::Vector3d& level : p.level) {
    m.along_m.push_back(level.x());
    m.across_m.push_back(level.y());
    m.up_m.push_back(level.z());
  }
  m.alert_along_m = config.alert_limit.x();
  m.alert_across_m = config.alert_limit.y();
  m.alert_up_m = config.alert_limit.z();
  m.usable = p.usable;
  m.reason = p.reason;
  m.hypothesis = code(p.hypothesis);
  m.since_check_s = p.since_check;
  return m;
}

void transform(const SE3& T, Odometry& pose) {
  pose.T_frame_vehicle = T * pose.T_frame_vehicle;
  const Eigen::Matrix3d R = T.R();
  pose.cov_pose.topLeftCorner<3, 3>() = (R * pose.cov_pose.topLeftCorner<3, 3>() * R.transpose()).eval();
}

/// One channel of poses: its bound and the frame that it is followed in.
struct Bounded {
  Bounded(const IntegrityConfig& config, double period) : monitor(config), slot(period) {}

  ProtectionMonitor monitor;
  PublishSlot slot;
  std::optional<Geodetic> anchor;  ///< of the first ENU pose: an INS that starts again may choose another

  void save(StateArchiveOut& a) const {
    const Geodetic place = anchor.value_or(Geodetic{});
    a(slot.last(), anchor.has_value(), place.latitude, place.longitude, place.height);
    ProtectionMonitor::archive(monitor, a);
  }

  void load(StateArchiveIn& a) {
    int64_t last = 0;
    bool known = false;
    Geodetic place;
    a(last, known, place.latitude, place.longitude, place.height);
    slot.set_last(last);
    if (known) anchor = place;
    ProtectionMonitor::archive(monitor, a);
  }
};

class IntegrityStage final : public Stage {
 public:
  IntegrityStage(std::string calibration, const IntegrityStageConfig& config)
      : config_(config),
        calibration_(std::move(calibration)),
        bounded_{Bounded(config.integrity, config.publish_period), Bounded(config.integrity, config.publish_period)} {
    spec_.name = "integrity";
    spec_.inputs = {{"AIDING_INS", "aiding_t", 100'000, 0},
                    {"POSE_WHEEL", "pose_t", 100'000, 0},
                    {"POSE_INS", "pose_t", 0, 0},
                    {"POSE_FUSED", "pose_t", 100'000, 0}};
    spec_.clocks = {{kIns, 300'000}, {kFused, 600'000}};
    spec_.state_layout = 2;
    spec_.outputs = {{"PROTECTION_INS", "protection_level_t"}, {"PROTECTION_FUSED", "protection_level_t"}};
  }

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }

  void apply(const Message& m) override {
    if (m.input == kAiding) {
      if (const auto z = position_innovation(decode<aiding_t>(m.bytes))) {
        for (Bounded& b : bounded_) b.monitor.add(*z);
      }
      return;
    }
    const pose_t pose = decode<pose_t>(m.bytes);
    if (m.input == kWheel) {
      const Odometry odometry_of_wheels = odometry(pose);
      for (Bounded& b : bounded_) b.monitor.add_witness(odometry_of_wheels, pose.run + pose.reset_counter);
      return;
    }
    const std::size_t channel = m.input == kIns ? 0 : 1;
    if (bounded_[channel].slot.due(m.utime)) bound(channel, pose);
  }

  void on_clock(const Message&) override {}

  void publish(int64_t, Outputs& outputs) override {
    for (auto& [output, message] : levels_) outputs.publish(output, message);
    levels_.clear();
  }

  void digest(Digest& digest) const override { digest.add(std::span<const uint8_t>(save())); }

  [[nodiscard]] std::vector<uint8_t> save() const override {
    StateArchiveOut a;
    for (const Bounded& b : bounded_) b.save(a);
    return a.out.take();
  }

  void load(std::span<const uint8_t> state) override {
    IntegrityStage loaded(calibration_, config_);
    StateArchiveIn a{StateReader(state)};
    for (Bounded& b : loaded.bounded_) b.load(a);
    a.in.finish();
    *this = std::move(loaded);
  }

  [[nodiscard]] std::string effective_config() const override { return config_text(config_); }
  [[nodiscard]] std::string explained_config() const override { return explained_config_text(config_); }
  [[nodiscard]] std::string effective_calibration() const override { return calibration_; }

 private:
  void bound(std::size_t channel, const pose_t& pose) {
    Bounded& b = bounded_[channel];
    // The fusion follows the INS.
    const std::optional<int64_t> since = bounded_[0].monitor.contradicted_since();
    if (channel == 1 && since) b.monitor.inherit_contradiction(*since);
    Odometry estimate = odometry(pose);
    if (pose.frame != pose_t::FRAME_ENU) estimate.validity = Validity::kInvalid;
    if (estimate.validity != Validity::kInvalid) {
      const Geodetic anchor{pose.anchor_lat_deg * kDegree, pose.anchor_lon_deg * kDegree, pose.anchor_height_m};
      if (!b.anchor) b.anchor = anchor;
      if (!same_anchor(anchor, *b.anchor)) transform(T_enu_enu(*b.anchor, anchor), estimate);
    }
    levels_.emplace_back(static_cast<int>(channel), message_of(b.monitor.bound(estimate), pose, config_.integrity));
  }

  IntegrityStageConfig config_;
  std::string calibration_;  ///< received, not used: the poses are the vehicle's already
  StageSpec spec_;
  std::array<Bounded, kBounded> bounded_;                   ///< POSE_INS, POSE_FUSED
  std::vector<std::pair<int, protection_level_t>> levels_;  ///< since the last publish()
};

}  // namespace

std::unique_ptr<Stage> make_integrity(const Calibration& calibration, const IntegrityStageConfig& config) {
  return std::make_unique<IntegrityStage>(calibration_text(calibration), config);
}

std::unique_ptr<Stage> make_integrity(const std::filesystem::path& vehicle_dir) {
  return make_integrity(load_calibration(vehicle_dir),
                        load_config_or_defaults<IntegrityStageConfig>(vehicle_dir / "integrity.yaml"));
}

}  // namespace roadfix
