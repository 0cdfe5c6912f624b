/// What the programs that measure have in common.
#pragma once

#include <sys/resource.h>

#include <cstdio>
#include <exception>

namespace roadfix::bench {

/// CPU of this process so far, all its threads, user and system.
inline double cpu_ms() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto ms = [](const timeval& t) {
    return 1e3 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_usec);
  };
  return ms(usage.ru_utime) + ms(usage.ru_stime);
}

/// run(argc, argv), or 2 and what it threw, on standard error.
template <class Run>
int run_as(const char* program, const Run& run, int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", program, e.what());
    return 2;
  }
}

}  // namespace roadfix::bench
