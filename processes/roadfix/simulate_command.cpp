// roadfix simulate: drives whose truth is known, as logs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <ctime>
#include <functional>
#include <iostream>
#include <memory>
#include <thread>

#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/console.h"
#include "roadfix/import/drive_log.h"
#include "roadfix/simulate/scenario_file.h"
#include "roadfix/simulate/scenario_request.h"
#include "roadfix/simulate/simulated_log.h"
#include "simulation/scenarios.h"
#include "stream/thread_pool.h"

namespace roadfix {
namespace {

struct SimulateOptions {
  ScenarioRequest request;
  std::uint64_t seed = 1;
  OutputOption out;
  std::filesystem::path vehicle;
  bool mono = false;
  bool stereo = false;
  bool no_camera = false;
  int threads = 0;
  bool list = false;
  bool print_config = false;
  bool progress = false;
  bool timing = false;
};

void print_list() {
  std::cout << "scenarios:\n";
  for (const std::string& name : scenario_names()) {
    std::cout << fmt::format("  {:<18} {:>5.0f} s  {}\n", name, scenario(name).duration_s, scenario_summary(name));
  }
  std::cout << "faults, as --fault NAME@START[+DURATION][:KEY=VALUE,...], times in s:\n";
  for (const FaultType& type : fault_types()) {
    std::string keys;
    for (const FaultParameter& p : type.parameters) keys += fmt::format(" {}={}", p.key, p.fallback);
    std::cout << fmt::format("  {:<18} {}{}\n", type.name, type.does, keys.empty() ? "" : ";" + keys);
  }
}

std::function<void(std::size_t)> shown_on(ProgressLine& line, std::size_t exposures) {
  const auto begin = std::chrono::steady_clock::now();
  return [&line, exposures, begin](std::size_t done) {
    const double taken_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    line.show(static_cast<double>(done) / static_cast<double>(exposures),
              fmt::format("{} of {} exposures, {:.1f} a second", done, exposures, static_cast<double>(done) / taken_s));
  };
}

ScenarioConfig configured(const SimulateOptions& options) {
  ScenarioRequest request = options.request;
  if (request.scenario.empty()) throw std::runtime_error("which scenario? (--list shows all)");
  if (options.mono) request.camera = CameraLayout::kMono;
  if (options.stereo) request.camera = CameraLayout::kStereo;
  if (options.no_camera) request.camera = CameraLayout::kNone;
  std::vector<std::string> remarks;
  const ScenarioConfig config = configured_scenario(request, remarks);
  for (const std::string& remark : remarks) say("simulate", remark);
  return config;
}

void run_simulate(const SimulateOptions& options) {
  if (options.list) return print_list();
  const ScenarioConfig config = configured(options);
  if (options.print_config) {
    std::cout << scenario_text(config);
    return;
  }
  if (options.out.path.empty()) throw std::runtime_error("--out DRIVE.lcm is missing");
  options.out.refuse_existing(std::filesystem::path(options.request.scenario));
  const auto begin = std::chrono::steady_clock::now();
  const SimulatedDrive drive = simulate(config, options.seed);
  if (!options.vehicle.empty()) {
    write_vehicle(calibration_of(drive), config.name, options.vehicle, options.out.overwrite);
  }
  ThreadPool threads(options.threads > 0 ? options.threads
                                         : std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  ProgressLine progress("simulate", options.progress);
  const std::string summary =
      write_simulated_log(drive, options.out.path, {threads, shown_on(progress, drive.exposures.size())});
  progress.end_line();
  const double taken_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::cout << options.out.path.string() << ": " << config.name << ", seed " << options.seed << "\n" << summary;
  if (!options.vehicle.empty()) std::cout << "vehicle: " << options.vehicle.string() << "\n";
  if (options.timing) {
    const double cpu_s = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
    std::cout << fmt::format("{:.0f} s simulated and written in {:.2f} s: {:.0f} x real time, {:.2f} s of CPU\n",
                             config.duration_s, taken_s, config.duration_s / taken_s, cpu_s);
    if (!drive.exposures.empty())
      std::cout << fmt::format("{} exposures: {:.2f} a second, {:.4f} s of CPU each\n", drive.exposures.size(),
                               static_cast<double>(drive.exposures.size()) / taken_s,
                               cpu_s / static_cast<double>(drive.exposures.size()));
  }
}

}  // namespace

void add_simulate_command(CLI::App& app) {
  const auto options = std::make_shared<SimulateOptions>();
  CLI::App* command = app.add_subcommand("simulate", "Make a drive log whose truth is known exactly");
  command->add_option("scenario", options->request.scenario, "name of a scenario, or a YAML file");
  command->add_option("--seed", options->seed, "of every random number")->capture_default_str();
  add_output(*command, options->out, "the log to write")->required(false);
  command->add_option("--vehicle", options->vehicle, "folder for calibration.yaml");
  command->add_option("--duration", options->request.duration_s, "s, in place of the scenario's own")
      ->check(CLI::Range(1.0, 86400.0));
  auto* mono = command->add_flag("--mono", options->mono, "with one camera");
  auto* stereo = command->add_flag("--stereo", options->stereo, "with two cameras")->excludes(mono);
  command->add_flag("--no-camera", options->no_camera, "without the scenario's cameras")->excludes(mono, stereo);
  command->add_option("--camera-rate-hz", options->request.camera_rate_hz, "pictures a second")
      ->check(CLI::Range(0.1, 100.0));
  command->add_option("--picture-size", options->request.picture_size, "WIDTHxHEIGHT in px; the field of view stays");
  command->add_flag("--png", options->request.lossless, "exact pictures instead of JPEG");
  command->add_option("--threads", options->threads, "that draw; the bytes do not depend on it (default: all)")
      ->check(CLI::Range(1, 256));
  command->add_option("--fault", options->request.faults, "NAME@START[+DURATION][:KEY=VALUE,...]; may be given again")
      ->allow_extra_args(false);
  command->add_flag("--list", options->list, "show scenarios and faults");
  command->add_flag("--print-config", options->print_config, "show the scenario's values as YAML");
  add_progress(*command, options->progress);
  command->add_flag("--timing", options->timing, "say how long it took");
  command->callback([options] { run_simulate(*options); });
}

}  // namespace roadfix
