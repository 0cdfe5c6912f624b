/// Who runs the tasks. An engine is given batches of task indices and a command that runs them; when, where and on what
/// is its own business: Slurm's, GNU parallel's, or that of plain processes beside this one.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace roadfix {

struct EngineOptions {
  std::string engine = "auto";  ///< of engine_names()
  int jobs = 0;                 ///< at a time; 0: one a core; of Slurm: its own limits
  std::size_t batch = 1;        ///< tasks one after the other in one job
  bool reversed = false;        ///< the last first
  bool progress = false;        ///< also where no terminal is
  bool wait = false;            ///< Slurm: stay until all have ended
  std::string partition;
  std::string account;
  double memory_mb = 0.0;                   ///< of a job; 0: as the cluster has it
  std::vector<std::string> sbatch_options;  ///< passed on as they are
};

const std::vector<std::string>& engine_names();

/// For "auto": Slurm where a cluster answers, GNU parallel where it is installed, local otherwise.
std::string chosen_engine(const std::string& name);

/// What is to be run.
struct EngineWork {
  std::filesystem::path program;                ///< roadfix, as workers find it
  std::filesystem::path run;                    ///< RUN
  std::filesystem::path batches;                ///< a file: the indices of one batch a line, with blanks between
  std::size_t count = 0;                        ///< lines
  int threads = 1;                              ///< of a task
  double time_limit_s = 0.0;                    ///< of a task
  std::function<void(const std::string&)> say;  ///< a line for the user
};

class Engine {
 public:
  virtual ~Engine() = default;
  /// Begins; throws where it cannot.
  virtual void start() = 0;
  /// False once nothing runs or waits any more. Call it often.
  virtual bool step() = 0;
  /// Ends what runs, starts nothing new; step() returns when all is over.
  virtual void stop() = 0;
  /// The work goes on without this process.
  [[nodiscard]] virtual bool detached() const { return false; }
};

std::unique_ptr<Engine> make_engine(const EngineOptions& options, const EngineWork& work);
std::unique_ptr<Engine> make_local_engine(const EngineOptions& options, const EngineWork& work);
std::unique_ptr<Engine> make_parallel_engine(const EngineOptions& options, const EngineWork& work);
std::unique_ptr<Engine> make_slurm_engine(const EngineOptions& options, const EngineWork& work);

/// Those of RUN's jobs that Slurm has still to end, by id; empty where there is no Slurm.
std::vector<std::string> unfinished_slurm_jobs(const std::filesystem::path& run);

int cores();

}  // namespace roadfix
