#include "bus/run/process_facts.h"

#include <gnu/libc-version.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <Eigen/Core>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "bus/run/build_id.h"

namespace roadfix {

namespace {

double cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double monotonic_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Libraries loaded into this process that compute something, by the full name of their file (which has the version).
std::set<std::string> loaded_libraries() {
  std::set<std::string> names;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const std::size_t slash = line.rfind('/');
    if (slash == std::string::npos) continue;
    const std::string name = line.substr(slash + 1);
    for (const char* computes : {"libm.so", "libopencv_core", "libceres", "libGeographic", "libblas", "liblapack"}) {
      if (name.starts_with(computes)) names.insert(name);
    }
  }
  return names;
}

}  // namespace

ProcessLoad::ProcessLoad() : cpu_s_(cpu_seconds()), monotonic_s_(monotonic_seconds()) {}

double ProcessLoad::cpu_share() {
  const double cpu_s = cpu_seconds();
  const double monotonic_s = monotonic_seconds();
  const double share = monotonic_s > monotonic_s_ ? (cpu_s - cpu_s_) / (monotonic_s - monotonic_s_) : 0.0;
  cpu_s_ = cpu_s;
  monotonic_s_ = monotonic_s;
  return share;
}

int64_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  int64_t total = 0;
  int64_t resident = 0;
  statm >> total >> resident;
  return resident * ::sysconf(_SC_PAGESIZE);
}

std::string build_id() { return build_id_text(); }

std::string library_versions() {
  std::ostringstream text;
  text << "libc " << ::gnu_get_libc_version() << "; eigen " << EIGEN_WORLD_VERSION << "." << EIGEN_MAJOR_VERSION << "."
       << EIGEN_MINOR_VERSION;
  for (const std::string& name : loaded_libraries()) text << "; " << name.substr(0, name.find('.')) << " " << name;
  return text.str();
}

std::string cpu_features() {
  std::ostringstream text;
#if defined(__x86_64__)
  text << "x86-64";
  if (__builtin_cpu_supports("sse4.2")) text << " sse4.2";
  if (__builtin_cpu_supports("avx2")) text << " avx2";
  if (__builtin_cpu_supports("fma")) text << " fma";
  if (__builtin_cpu_supports("bmi2")) text << " bmi2";
  if (__builtin_cpu_supports("avx512f")) text << " avx512f";
#elif defined(__aarch64__)
  text << "aarch64";
#endif
  if (const char* disabled = std::getenv("OPENCV_CPU_DISABLE")) text << " opencv without " << disabled;
  return text.str();
}

}  // namespace roadfix
