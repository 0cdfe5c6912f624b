// Slurm job arrays: one array task a batch. Slurm queues, places, limits and requeues; this file calls sbatch, squeue
// and scancel.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

#include "config/config_error.h"
#include "roadfix/fleet/child_process.h"
#include "roadfix/fleet/engine.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr auto kPoll = std::chrono::seconds(1);
constexpr std::size_t kDefaultMaxArray = 1001;  ///< Slurm's own default: indices 0 to 1000
constexpr double kMargin_min = 5.0;             ///< beyond the tasks' own limits

fs::path ids_path(const fs::path& run) { return run / "jobs" / "slurm_jobs.txt"; }

/// The base ids of this user's arrays in the queue; nothing where the controller does not answer.
std::optional<std::set<std::string>> queued() {
  const ProgramOutput output = run_program({"squeue", "--me", "--noheader", "--format=%F"});
  if (output.status != 0) return std::nullopt;
  std::istringstream lines(output.text);
  std::set<std::string> ids;
  for (std::string id; lines >> id;) ids.insert(id);
  return ids;
}

std::size_t max_array() {
  std::istringstream lines(run_program({"scontrol", "show", "config"}).text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t equals = line.find('=');
    if (line.starts_with("MaxArraySize") && equals != std::string::npos) {
      return std::max<std::size_t>(1, std::stoul(line.substr(equals + 1)));
    }
  }
  return kDefaultMaxArray;
}

std::string trimmed(std::string text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.pop_back();
  return text;
}

class SlurmEngine : public Engine {
 public:
  SlurmEngine(const EngineOptions& options, EngineWork work) : options_(options), work_(std::move(work)) {}

  void start() override {
    if (!is_installed("sbatch"))
      throw std::runtime_error(
          "--engine slurm: needs Slurm's commands (Debian: slurm-client; scripts/setup --with-slurm)");
    const std::size_t most = max_array();
    for (std::size_t first = 0; first < work_.count; first += most) submit(first, std::min(most, work_.count - first));
    work_.say(
        fmt::format("Slurm has taken {} batches as job {}", work_.count, fmt::format("{}", fmt::join(ids_, ", "))));
  }

  bool step() override {
    if (!options_.wait && !stopping_) return false;
    if (Clock::now() < next_poll_) return waiting_;
    next_poll_ = Clock::now() + kPoll;
    const auto queue = queued();
    if (!queue && !silent_) work_.say("Slurm's controller does not answer; waiting for it");
    silent_ = !queue;
    if (!queue) return waiting_ = true;
    return waiting_ = std::any_of(ids_.begin(), ids_.end(), [&](const std::string& id) { return queue->contains(id); });
  }

  void stop() override {
    stopping_ = true;
    std::vector<std::string> command = {"scancel"};
    command.insert(command.end(), ids_.begin(), ids_.end());
    if (!ids_.empty()) run_program(command);
  }

  [[nodiscard]] bool detached() const override { return !options_.wait; }

 private:
  void submit(std::size_t first, std::size_t count) {
    const fs::path script = work_.batches.string() + fmt::format(".{}.sh", first);
    write_text_file(script, fmt::format("#!/bin/sh\n"
                                        "# One array task of a fleet: the tasks of line {} + SLURM_ARRAY_TASK_ID.\n"
                                        "tasks=$(sed -n \"$(({} + SLURM_ARRAY_TASK_ID))p\" {})\n"
                                        "exec {} fleet task {} $tasks\n",
                                        first + 1, first + 1, shell_word(work_.batches.string()),
                                        shell_word(work_.program.string()), shell_word(work_.run.string())));
    const ProgramOutput output = run_program(sbatch(script, count));
    if (output.status != 0) throw std::runtime_error("sbatch: " + trimmed(output.error));
    // "ID" or "ID;CLUSTER"
    ids_.push_back(trimmed(output.text).substr(0, trimmed(output.text).find(';')));
    std::ofstream(ids_path(work_.run), std::ios::app) << ids_.back() << "\n";
  }

  [[nodiscard]] std::vector<std::string> sbatch(const fs::path& script, std::size_t count) const {
    const std::string limit = options_.jobs > 0 ? fmt::format("%{}", options_.jobs) : "";
    const double minutes = std::ceil(static_cast<double>(options_.batch) * work_.time_limit_s / 60.0) + kMargin_min;
    std::vector<std::string> command = {"sbatch",
                                        "--parsable",
                                        "--requeue",
                                        "--open-mode=append",
                                        "--job-name=roadfix-fleet",
                                        fmt::format("--array=0-{}{}", count - 1, limit),
                                        fmt::format("--time={:.0f}", minutes),
                                        fmt::format("--cpus-per-task={}", work_.threads),
                                        "--chdir=" + work_.run.string(),
                                        "--output=" + (work_.run / "jobs" / "slurm-%A_%a.txt").string()};
    if (!options_.partition.empty()) command.push_back("--partition=" + options_.partition);
    if (!options_.account.empty()) command.push_back("--account=" + options_.account);
    if (options_.memory_mb > 0.0) command.push_back(fmt::format("--mem={:.0f}M", options_.memory_mb));
    command.insert(command.end(), options_.sbatch_options.begin(), options_.sbatch_options.end());
    command.push_back(script.string());
    return command;
  }

  EngineOptions options_;
  EngineWork work_;
  std::vector<std::string> ids_;
  Clock::time_point next_poll_;
  bool waiting_ = true;
  bool silent_ = false;
  bool stopping_ = false;
};

}  // namespace

std::unique_ptr<Engine> make_slurm_engine(const EngineOptions& options, const EngineWork& work) {
  return std::make_unique<SlurmEngine>(options, work);
}

std::vector<std::string> unfinished_slurm_jobs(const fs::path& run) {
  std::ifstream lines(ids_path(run));
  if (!lines || !is_installed("squeue")) return {};
  const auto queue = queued();
  std::vector<std::string> out;
  for (std::string id; lines >> id;) {
    if (queue && queue->contains(id)) out.push_back(id);
  }
  return out;
}

}  // namespace roadfix
