/// What the subcommands of the tool share: one word for one thing. A subcommand takes these instead of adding options
/// of the same name itself; test/scripts/tool_test.py holds all of them against each other.
///
/// Exit status of every program: 0 done; 1 done, and what was looked at is not good (verify, log check, doctor); 2 not
/// done, for a reason that the user can mend, which is printed on standard error as "roadfix SUBCOMMAND: ...".
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming): not ours
class App;
class Option;
}  // namespace CLI

namespace roadfix {

/// The status of a subcommand that has found something not to be good: throw CLI::RuntimeError(kNotGood).
inline constexpr int kNotGood = 1;

/// --out PATH and --overwrite. What is there already is replaced on request only; a device or pipe has nothing to lose.
struct OutputOption {
  std::filesystem::path path;
  bool overwrite = false;

  /// Throws std::runtime_error where `path` is there and --overwrite was not given, or is `input` under whatever name.
  /// To be called before any work.
  void refuse_existing(const std::filesystem::path& input = {}) const { refuse_existing_file(path, input); }
  /// The same for another file that the subcommand writes.
  void refuse_existing_file(const std::filesystem::path& file, const std::filesystem::path& input = {}) const;
};

/// --out (required) and --overwrite.
CLI::Option* add_output(CLI::App& command, OutputOption& output, const std::string& what);

/// --overwrite alone.
CLI::Option* add_overwrite(CLI::App& command, bool& overwrite);

/// --config FOLDER: the vehicle's configuration folder, required.
CLI::Option* add_config(CLI::App& command, std::filesystem::path& folder,
                        const std::string& what = "The vehicle's configuration folder");

/// --channel NAME[,NAME...], again for more.
CLI::Option* add_channels(CLI::App& command, std::vector<std::string>& channels, const std::string& what);

/// --stages NAME[,NAME...].
CLI::Option* add_stages(CLI::App& command, std::vector<std::string>& stages, const std::string& what);

/// --progress (roadfix/console.h: ProgressLine).
CLI::Option* add_progress(CLI::App& command, bool& progress);

}  // namespace roadfix
