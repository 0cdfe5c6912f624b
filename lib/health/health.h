/// What the monitor decides, without bus, clock or file: from what arrived and when it follows whether the estimate may
/// be used, and why not. Derivation: lib/health/MODEL.md, (H.n).
///
/// Time is data: `now` comes with every call and never runs backwards here; live it is the clock, of a log the time of
/// recording. Decisions fall on a grid of 0.1 s, so that the same messages at the same times give the same reports.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "health/agreement.h"
#include "health/alarms.h"
#include "health/channel_monitor.h"
#include "health/nis_monitor.h"
#include "health/pose_monitor.h"
#include "health/process_monitor.h"

namespace roadfix {

/// What only the machine itself knows; absent on a log.
struct HostFacts {
  std::optional<double> free_disk_gib;  ///< where drives are recorded to
  std::optional<double> clock_step_s;   ///< the computer's clock minus what the stack counts
  int64_t kernel_drops = 0;             ///< at the monitor's own socket, since start
};

struct HealthReport {
  int64_t now_us = 0;
  Verdict verdict = Verdict::kDoNotUse;
  int64_t since_us = 0;
  std::vector<Condition> reasons;
  std::string judged_pose;  ///< the channel that the verdict is about; empty: none has arrived
  double lag_s = 0.0;       ///< of a drive that is played again: how old its stamps are
  std::vector<ChannelReport> channels;
  std::vector<ProcessReport> processes;
  std::vector<PoseReport> poses;
  std::vector<NisReport> consistency;
  std::vector<Agreement> agreements;
};

class Health {
 public:
  Health(const HealthConfig& config, const Expectations& expectations);

  void arrived(const std::string& channel, const Arrival& arrival);
  void undecodable(const std::string& channel, int64_t now_us, const std::string& why);
  void unusable(const std::string& channel, int64_t now_us);
  void heartbeat(const std::string& process, int64_t now_us, const HeartbeatFacts& facts);
  void pose(const std::string& channel, int64_t now_us, PoseFacts facts);
  /// Of an estimate that is known already.
  void bound(const std::string& channel, const BoundFacts& facts);
  /// `source`: "POSE_VO in FUSION"; of a pose that begins anew what came before is forgotten.
  void measurement(const std::string& source, int64_t now_us, double nis, int dof, bool accepted);
  void host(int64_t now_us, const HostFacts& facts);

  /// The next moment of decision that `now` has reached; nothing when none has. After a long silence of everything (a
  /// log with a hole) only the last few are made up for.
  [[nodiscard]] std::optional<int64_t> next_decision(int64_t now_us);

  /// Decides. True where the verdict or the set of reasons changed.
  bool decide(int64_t now_us);

  [[nodiscard]] Verdict verdict() const { return alarms_.verdict(); }
  [[nodiscard]] HealthReport report() const;  ///< of the last decision
  [[nodiscard]] const std::map<std::string, PoseMonitor>& poses() const { return poses_; }
  /// Of the frame that absolute poses are kept in here: the first one offered or received.
  [[nodiscard]] const std::optional<Geodetic>& anchor() const { return anchor_; }
  void offer_anchor(const Geodetic& anchor) {
    if (!anchor_) anchor_ = anchor;
  }
  /// Takes an absolute pose into that frame.
  void to_common_frame(PoseFacts& facts);

 private:
  ChannelMonitor& channel(const std::string& name);
  [[nodiscard]] std::string judged_pose() const;
  [[nodiscard]] int64_t median_lag_us() const;
  void check_host(std::vector<Condition>& out) const;
  [[nodiscard]] std::vector<Agreement> agreements() const;

  HealthConfig config_;
  Expectations expectations_;
  Alarms alarms_;
  std::map<std::string, ChannelMonitor> channels_;
  std::map<std::string, ProcessMonitor> processes_;
  std::map<std::string, PoseMonitor> poses_;
  std::map<std::string, NisMonitor> sources_;
  HostFacts host_;
  Recent monitor_drops_;
  std::optional<Geodetic> anchor_;
  std::optional<int64_t> start_us_;  ///< of the first call
  int64_t decided_us_ = 0;
  int64_t lag_us_ = 0;
};

}  // namespace roadfix
