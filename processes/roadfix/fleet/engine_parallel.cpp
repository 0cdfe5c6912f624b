// GNU parallel on this machine: `parallel --jobs N` over the list of batches.
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>

#include <stdexcept>

#include "roadfix/fleet/child_process.h"
#include "roadfix/fleet/engine.h"

namespace roadfix {
namespace {

class ParallelEngine : public Engine {
 public:
  ParallelEngine(const EngineOptions& options, EngineWork work)
      : work_(std::move(work)), jobs_(options.jobs > 0 ? options.jobs : cores()) {}

  void start() override {
    if (!is_installed("parallel")) throw std::runtime_error("--engine parallel: needs the Debian package parallel");
    // Tasks say in their results how they ended: no job's status stops the others. SIGTERM lets a task clear up.
    const std::string command =
        fmt::format("{} fleet task {}", shell_word(work_.program.string()), shell_word(work_.run.string()));
    process_ = start_program({"parallel", "--will-cite", "--plain", "--jobs", std::to_string(jobs_), "--halt", "never",
                              "--termseq", "TERM,20000,KILL,25", "--no-run-if-empty", "--arg-file",
                              work_.batches.string(), "--colsep", " ", command + " {}"});
  }

  bool step() override {
    if (process_ == 0) return false;
    const std::optional<int> status = ended(process_);
    if (!status) return true;
    process_ = 0;
    if (WIFEXITED(*status) && WEXITSTATUS(*status) == 255) work_.say("GNU parallel failed");
    return false;
  }

  /// The first SIGTERM lets running jobs end by themselves, the second ends them.
  void stop() override {
    if (process_ == 0) return;
    ::kill(process_, SIGTERM);
    ::kill(process_, SIGTERM);
  }

 private:
  EngineWork work_;
  int jobs_;
  pid_t process_ = 0;
};

}  // namespace

std::unique_ptr<Engine> make_parallel_engine(const EngineOptions& options, const EngineWork& work) {
  return std::make_unique<ParallelEngine>(options, work);
}

}  // namespace roadfix
