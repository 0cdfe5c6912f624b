/// What this process is and what it takes of the machine: for heartbeats and configuration messages.
#pragma once

#include <cstdint>
#include <string>

namespace roadfix {

/// CPU time since the last call, as a share of one core.
class ProcessLoad {
 public:
  ProcessLoad();
  [[nodiscard]] double cpu_share();

 private:
  double cpu_s_;
  double monotonic_s_;
};

int64_t resident_bytes();

/// What decides whether two processes compute the same bits (docs/DESIGN.md, section 5).
std::string build_id();          ///< of the sources and flags that this program was built from
std::string library_versions();  ///< of what computes: the C library, Eigen
std::string cpu_features();      ///< what the C library and others dispatch on

}  // namespace roadfix
