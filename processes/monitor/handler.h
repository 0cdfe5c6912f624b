/// Everything on the bus, handed to lib/health: checks and translates, decides nothing. Live and over a log alike.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "bus/bus.h"
#include "bus/types/schema.h"
#include "health/health.h"
#include "monitor/monitor_config.h"

namespace roadfix {

/// What else wants to see the decoded messages: the dashboard.
class MonitorListener {
 public:
  virtual ~MonitorListener() = default;
  /// A message of our own types, already checked.
  virtual void message(const std::string& channel, const std::string& type, const BusMessage& message,
                       int64_t now_us) = 0;
  /// After each decision, ten a second.
  virtual void decided(const HealthReport& report, bool changed) = 0;
};

class MonitorHandler {
 public:
  MonitorHandler(const MonitorConfig& config, const Expectations& expectations)
      : health_(config.health, expectations) {}

  /// Outlives the handler. In the order of adding.
  void add(MonitorListener& listener) { listeners_.push_back(&listener); }

  /// Takes one message as it came; whatever it is, this does not throw for it. `now_us` may run backwards: it is taken
  /// as standing still.
  void take(const BusMessage& message, int64_t now_us);

  /// Makes the decisions that are due.
  void advance(int64_t now_us);

  [[nodiscard]] Health& health() { return health_; }

 private:
  struct Channel {
    std::string type;
    std::optional<MessageCheck> check;
  };
  Channel* channel(const std::string& name);
  void translate(const std::string& channel, const std::string& type, std::span<const uint8_t> bytes);

  Health health_;
  std::vector<MonitorListener*> listeners_;
  std::map<std::string, Channel, std::less<>> channels_;
  int64_t now_us_ = 0;
};

}  // namespace roadfix
