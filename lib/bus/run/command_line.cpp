#include "bus/run/command_line.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "bus/log/output_place.h"
#include "bus/run/build_id.h"
#include "bus/transport/network_bus.h"

namespace roadfix {

namespace {
constexpr int kUserError = 2;
}

CommandLine::CommandLine(const std::string& description, Config wanted, const std::string& footer)
    : bus(kDefaultBusUrl), app_(std::make_unique<CLI::App>(description)) {
  app_->footer(footer);
  app_->add_option("--config", config, "The vehicle's configuration folder")->required(wanted == Config::kRequired);
  app_->add_option("--bus", bus, "LCM URL")->capture_default_str();
  app_->add_option("--realtime", realtime, "Scheduling priority (SCHED_FIFO); others wait while this runs")
      ->check(CLI::Range(1, 99));
  app_->add_flag("--print-config", print_config, "Print the effective configuration and end");
}

CommandLine::~CommandLine() = default;

void CommandLine::option(const std::string& name, std::string& value, const std::string& help) {
  app_->add_option(name, value, help);
}

void CommandLine::add_logs(const std::string& help_in, const std::string& help_out) {
  CLI::Option* in = app_->add_option("--log-in", log_in, help_in);
  CLI::Option* out = app_->add_option("--log-out", log_out, help_out);
  in->needs(out);
  out->needs(in);
  add_overwrite();
}

void CommandLine::add_overwrite() { app_->add_flag("--overwrite", overwrite, "Replace what is there already"); }

int CommandLine::run(int argc, char** argv, const std::function<int()>& work) {
  const std::string name = argc > 0 ? std::filesystem::path(argv[0]).filename().string() : "roadfix";
  app_->name(name);
  app_->set_version_flag("--version", version_text(name), "Print version and build, and end");
  try {
    app_->parse(argc, argv);
    if (!log_in.empty() && !log_out.empty()) {
      refuse_to_replace(log_in, log_out);
      refuse_existing_file(log_out, overwrite);
    }
    return work();
  } catch (const CLI::ParseError& e) {
    return end_of_parsing(*app_, e, name);
  } catch (const std::exception& e) {
    std::cerr << name << ": " << e.what() << "\n";
    return kUserError;
  }
}

int end_of_parsing(const CLI::App& app, const CLI::ParseError& error, const std::string& name) {
  if (dynamic_cast<const CLI::RuntimeError*>(&error) != nullptr) return error.get_exit_code();
  if (error.get_exit_code() == 0) return app.exit(error);
  std::cout << std::flush;
  std::cerr << name << ": " << error.what() << " (" << name << " --help tells more)\n";
  return kUserError;
}

}  // namespace roadfix
