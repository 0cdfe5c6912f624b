/// The command line that all of our processes on the bus share: the same options with the same texts, and the same exit
/// status: 0, 2 for what the user can mend (printed to stderr as "NAME: ..."), or what the process itself returns.
#pragma once

#include <functional>
#include <memory>
#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): not ours
class App;
class ParseError;
}  // namespace CLI

namespace roadfix {

class CommandLine {
 public:
  enum class Config { kRequired, kOptional };

  CommandLine(const std::string& description, Config config, const std::string& footer = "");
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  /// For what only this process takes.
  void option(const std::string& name, std::string& value, const std::string& help);
  CLI::App& app() { return *app_; }
  /// --log-in and --log-out, which go together, and --overwrite.
  void add_logs(const std::string& help_in, const std::string& help_out);
  void add_overwrite();

  /// Reads the arguments and works. What `work` throws is printed for the user.
  int run(int argc, char** argv, const std::function<int()>& work);

  std::string config;  ///< the vehicle's folder
  std::string bus;
  std::string log_in, log_out;
  bool overwrite = false;  ///< --log-out may replace a log
  int realtime = 0;        ///< priority; 0: as everybody
  bool print_config = false;

 private:
  std::unique_ptr<CLI::App> app_;
};

/// The exit status after an application's parse() has thrown: prints the help or the version that was asked for, or
/// prints under `name` what is wrong with the arguments. A RuntimeError is a status alone: its meaning was printed.
int end_of_parsing(const CLI::App& app, const CLI::ParseError& error, const std::string& name);

}  // namespace roadfix
