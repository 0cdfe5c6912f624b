#include "roadfix/fleet/engine.h"

#include <sched.h>

#include <algorithm>
#include <stdexcept>

#include "roadfix/fleet/child_process.h"

namespace roadfix {

const std::vector<std::string>& engine_names() {
  static const std::vector<std::string> kNames = {"auto", "slurm", "parallel", "local"};
  return kNames;
}

std::string chosen_engine(const std::string& name) {
  if (name != "auto") return name;
  if (is_installed("sbatch") && run_program({"timeout", "10", "sinfo", "--noheader"}).status == 0) return "slurm";
  return is_installed("parallel") ? "parallel" : "local";
}

std::unique_ptr<Engine> make_engine(const EngineOptions& options, const EngineWork& work) {
  const std::string engine = chosen_engine(options.engine);
  if (engine == "local") return make_local_engine(options, work);
  if (engine == "parallel") return make_parallel_engine(options, work);
  if (engine == "slurm") return make_slurm_engine(options, work);
  throw std::runtime_error("--engine " + engine + ": must be slurm, parallel or local");
}

int cores() {
  cpu_set_t mine;
  return ::sched_getaffinity(0, sizeof mine, &mine) == 0 ? std::max(1, CPU_COUNT(&mine)) : 1;
}

}  // namespace roadfix
