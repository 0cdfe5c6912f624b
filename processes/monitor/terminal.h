/// Where the screen goes: a terminal, updated in place, or plain lines where there is none.
#pragma once

#include <string>
#include <vector>

#include "monitor/handler.h"

namespace roadfix {

class Terminal : public MonitorListener {
 public:
  /// `plain`: lines even on a terminal. `footer`: one line under the page, for example where the dashboard is.
  Terminal(bool plain, const std::string& footer);
  ~Terminal() override;
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  void message(const std::string& channel, const std::string& type, const BusMessage& message, int64_t now_us) override;
  void decided(const HealthReport& report, bool changed) override;

 private:
  void draw(const HealthReport& report);

  bool in_place_;
  std::string footer_;
  int64_t drawn_us_ = 0;
  std::vector<std::string> fusion_;  ///< what the fusion said last ...
  int64_t fusion_us_ = 0;            ///< ... and when
};

}  // namespace roadfix
