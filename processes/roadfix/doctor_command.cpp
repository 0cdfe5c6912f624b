// roadfix doctor: is this machine ready for the bus?
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <memory>

#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/doctor/doctor.h"

namespace roadfix {
namespace {

struct DoctorOptions {
  std::string url;
  std::filesystem::path log_folder = ".";
  double wanted_gib = 10.0;
  bool loopback = true;
};

void run_doctor(const DoctorOptions& options) {
  const BusUrl url = parse_bus_url(options.url);
  std::vector<Finding> findings;
  const auto add = [&](const std::vector<Finding>& more) { findings.insert(findings.end(), more.begin(), more.end()); };
  const Finding route = check_route("/", url);
  add({route, check_ttl(url)});
  add(check_buffers("/"));
  add(check_reassembly("/", url));
  if (options.loopback && route.level != Level::kError) add({check_loopback(options.url)});
  const char* path = std::getenv("PATH");
  // bin/roadfix and roadfix_types.jar lie in one build folder.
  const std::filesystem::path build = std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path();
  add(check_spy(path != nullptr ? path : "", "/", build / "roadfix_types.jar"));
  constexpr double kGibi = 1024.0 * 1024.0 * 1024.0;
  add({check_clock(), check_disk(options.log_folder, static_cast<std::uint64_t>(options.wanted_gib * kGibi))});
  add({check_realtime()});
  add(check_services("/"));
  add(check_devices("/"));
  if (print_findings(findings, std::cout) == Level::kError) throw CLI::RuntimeError(kNotGood);
}

}  // namespace

void add_doctor_command(CLI::App& app) {
  const auto options = std::make_shared<DoctorOptions>();
  const char* url = std::getenv("LCM_DEFAULT_URL");
  options->url = url != nullptr ? url : "udpm://239.255.76.67:7667?ttl=0";
  CLI::App* command = app.add_subcommand("doctor",
                                         "Check route, buffers, TTL, loop-back, Java, clock, disk, real time, services "
                                         "and devices; print what mends each");
  command->add_option("--bus,--url", options->url, "LCM URL")->capture_default_str();
  command->add_option("--logs", options->log_folder, "where recordings go")->capture_default_str();
  command->add_option("--space-gib", options->wanted_gib, "space that a drive wants")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  command->add_flag("!--no-loopback", options->loopback, "send nothing, not even to ourselves");
  command->footer("Exit status: 0 the bus works (warnings too), 1 it does not, 2 wrong usage.");
  command->callback([options] { run_doctor(*options); });
}

}  // namespace roadfix
