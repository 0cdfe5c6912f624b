#include "monitor/host_facts.h"

#include <chrono>

namespace roadfix {

HostMonitor::HostMonitor(const std::filesystem::path& recordings)
    : recordings_(std::filesystem::absolute(recordings)) {}

HostFacts HostMonitor::facts(int64_t now_us, int64_t kernel_drops) {
  asked_us_ = now_us;
  HostFacts facts;
  facts.kernel_drops = kernel_drops;
  std::filesystem::path folder = recordings_;
  while (!std::filesystem::exists(folder) && folder.has_relative_path()) folder = folder.parent_path();
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  constexpr double kGibi = 1024.0 * 1024.0 * 1024.0;
  if (!error) facts.free_disk_gib = static_cast<double>(space.available) / kGibi;
  // The run's clock does not follow a step of the wall clock but by 100 ppm: what is left of it shows here.
  const auto wall = std::chrono::system_clock::now().time_since_epoch();
  facts.clock_step_s =
      static_cast<double>(std::chrono::duration_cast<std::chrono::microseconds>(wall).count() - now_us) * 1e-6;
  return facts;
}

}  // namespace roadfix
