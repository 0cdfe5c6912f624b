/// HEALTH and HEARTBEAT_MONITOR onto a bus.
#pragma once

#include <optional>

#include "bus/bus.h"
#include "bus/run/process_facts.h"
#include "bus/run/unsent_monitor.h"
#include "monitor/handler.h"

namespace roadfix {

class HealthPublisher : public MonitorListener {
 public:
  /// `started_us`: when this process began, which decides which of two monitors is the older one; nothing where a log is
  /// read: no heartbeat, for nothing lives there.
  HealthPublisher(Bus& bus, double period_s, std::optional<int64_t> started_us);

  /// Live: where HEALTH comes from a monitor that has run for longer, this one shows and is silent, until the other is.
  /// For that it listens for a while before its first word.
  void received(const BusMessage& message, int64_t now_us);

  void message(const std::string&, const std::string&, const BusMessage&, int64_t) override {}
  void decided(const HealthReport& report, bool changed) override;

 private:
  void publish_heartbeat(int64_t now_us);
  [[nodiscard]] bool must_be_silent(int64_t now_us) const;

  Bus& bus_;
  int64_t period_us_;
  bool live_;
  ProcessLoad load_;
  UnsentMonitor unsent_;
  int64_t run_;
  int64_t listens_since_us_ = 0;
  int64_t seq_ = 0, heartbeat_seq_ = 0;
  int64_t published_us_ = 0, heartbeat_us_ = 0;
  std::optional<int64_t> other_us_;  ///< when an older monitor published last
};

}  // namespace roadfix
