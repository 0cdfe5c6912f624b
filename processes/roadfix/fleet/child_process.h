/// Programs started by an engine, each in a process group of its own, and what they print.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace roadfix {

/// Starts a program, found in PATH; it gets SIGTERM when this process dies. std::runtime_error where it cannot be
/// started.
pid_t start_program(const std::vector<std::string>& command);

/// Its status once it has ended.
std::optional<int> ended(pid_t process);

struct ProgramOutput {
  int status = 0;     ///< exit status; 127 where there is no such program
  std::string text;   ///< standard output
  std::string error;  ///< standard error
};

/// Runs a program to its end.
ProgramOutput run_program(const std::vector<std::string>& command);

/// The text as a shell reads it as one word.
std::string shell_word(const std::string& text);

bool is_installed(const std::string& program);

}  // namespace roadfix
