// Plain processes beside this one, so many at a time: what xargs -P does.
#include <signal.h>

#include <fstream>
#include <sstream>
#include <vector>

#include "roadfix/fleet/child_process.h"
#include "roadfix/fleet/engine.h"

namespace roadfix {
namespace {

class LocalEngine : public Engine {
 public:
  LocalEngine(const EngineOptions& options, EngineWork work)
      : work_(std::move(work)), jobs_(static_cast<std::size_t>(options.jobs > 0 ? options.jobs : cores())) {}

  void start() override {
    std::ifstream lines(work_.batches);
    for (std::string line; std::getline(lines, line);) waiting_.push_back(line);
    step();
  }

  bool step() override {
    std::erase_if(running_, [](pid_t process) { return ended(process).has_value(); });
    while (!stopping_ && running_.size() < jobs_ && next_ < waiting_.size()) {
      std::vector<std::string> command = {work_.program.string(), "fleet", "task", work_.run.string()};
      std::istringstream indices(waiting_[next_++]);
      for (std::string index; indices >> index;) command.push_back(index);
      running_.push_back(start_program(command));
    }
    return !running_.empty();
  }

  void stop() override {
    stopping_ = true;
    for (const pid_t process : running_) ::kill(process, SIGTERM);
  }

 private:
  EngineWork work_;
  std::size_t jobs_;
  std::vector<std::string> waiting_;
  std::size_t next_ = 0;
  std::vector<pid_t> running_;
  bool stopping_ = false;
};

}  // namespace

std::unique_ptr<Engine> make_local_engine(const EngineOptions& options, const EngineWork& work) {
  return std::make_unique<LocalEngine>(options, work);
}

}  // namespace roadfix
