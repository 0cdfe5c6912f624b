// No memory is asked for once the filter is aligned: neither by predictions nor by updates.
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdlib>

#include "filter_run.h"

namespace {

bool g_counting = false;
std::size_t g_allocations = 0;

}  // namespace

#if defined(__SANITIZE_ADDRESS__)
constexpr bool kCounts = false;  // the sanitizer has these functions for itself
#else
constexpr bool kCounts = true;

// The program's own: operator new and Eigen end here.
extern "C" {
// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): glibc's names
void* __libc_malloc(std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

void* malloc(std::size_t size) noexcept {
  g_allocations += g_counting ? 1 : 0;
  return __libc_malloc(size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  g_allocations += g_counting ? 1 : 0;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) noexcept {
  g_allocations += g_counting ? 1 : 0;
  *out = __libc_memalign(alignment, size);
  return *out == nullptr ? ENOMEM : 0;
}
}
#endif

using namespace roadfix;
using namespace roadfix::navigation;

TEST_CASE("an aligned filter does not allocate") {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 60.0;
  const SimulatedDrive drive = simulate(s, 3);
  Navigation filter(navtest::filter_config(drive.config));
  std::size_t fix = 0, wheel = 0, updates = 0;
  for (const ImuSample& imu : drive.imu) {
    g_counting = filter.status().phase == Phase::kDone;
    (void)filter.see(imu);
    while (fix < drive.gnss.size() && drive.gnss[fix].t_us <= imu.t_us) filter.add(drive.gnss[fix++]);
    while (wheel < drive.wheels.size() && drive.wheels[wheel].t_us <= imu.t_us) filter.add(drive.wheels[wheel++]);
    (void)filter.advance(imu);
    updates += g_counting ? filter.records().size() : 0;
    g_counting = false;
    filter.clear_records();
  }
  CHECK(updates > 500);
  CHECK(g_allocations == 0);
  if (!kCounts) return;
  // Teeth: an allocation is seen.
  g_counting = true;
  const std::vector<double> some(100, 1.0);
  g_counting = false;
  CHECK(some.size() == 100);
  CHECK(g_allocations > 0);
}
