/// What only the machine itself can tell the monitor: disk and clock.
#pragma once

#include <filesystem>

#include "bus/run/run_clock.h"
#include "health/health.h"

namespace roadfix {

class HostWatch {
 public:
  explicit HostWatch(const std::filesystem::path& recordings);

  /// Once a second.
  [[nodiscard]] bool due(int64_t now_us) const { return now_us - asked_us_ >= 1'000'000; }
  [[nodiscard]] HostFacts facts(int64_t now_us, int64_t kernel_drops);

 private:
  std::filesystem::path recordings_;
  int64_t asked_us_ = 0;
};

}  // namespace roadfix
