/// What only the machine itself provides: disk and clock.
#pragma once

#include <filesystem>

#include "bus/run/run_clock.h"
#include "health/health.h"

namespace roadfix {

class HostMonitor {
 public:
  explicit HostMonitor(const std::filesystem::path& recordings);

  /// Once a second.
  [[nodiscard]] bool due(int64_t now_us) const { return now_us - asked_us_ >= 1'000'000; }
  [[nodiscard]] HostFacts facts(int64_t now_us, int64_t kernel_drops);

 private:
  std::filesystem::path recordings_;
  int64_t asked_us_ = 0;
};

}  // namespace roadfix
