#include "roadfix/fleet/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <stdexcept>

namespace roadfix {
namespace {

constexpr int kNoProgram = 127;

[[noreturn]] void become(const std::vector<std::string>& command) {
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  ::execvp(words[0], words.data());
  std::_Exit(kNoProgram);
}

pid_t fork_or_throw(const std::vector<std::string>& command) {
  const pid_t process = ::fork();
  if (process < 0) throw std::runtime_error(fmt::format("{}: no process for it: {}", command[0], std::strerror(errno)));
  return process;
}

/// Both pipes until both are closed.
void read_all(std::array<int, 2> pipes, std::array<std::string*, 2> texts) {
  std::array<pollfd, 2> polled = {pollfd{pipes[0], POLLIN, 0}, pollfd{pipes[1], POLLIN, 0}};
  while (polled[0].fd >= 0 || polled[1].fd >= 0) {
    if (::poll(polled.data(), polled.size(), -1) < 0 && errno != EINTR) break;
    for (std::size_t i = 0; i < polled.size(); ++i) {
      if (polled[i].fd < 0 || polled[i].revents == 0) continue;
      std::array<char, 4096> block;
      const ssize_t n = ::read(polled[i].fd, block.data(), block.size());
      if (n > 0) texts[i]->append(block.data(), static_cast<std::size_t>(n));
      if (n == 0) polled[i].fd = -1;
    }
  }
}

}  // namespace

pid_t start_program(const std::vector<std::string>& command) {
  const pid_t process = fork_or_throw(command);
  if (process != 0) {
    ::setpgid(process, process);
    return process;
  }
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  become(command);
}

std::optional<int> ended(pid_t process) {
  int status = 0;
  if (::waitpid(process, &status, WNOHANG) == 0) return std::nullopt;
  return status;
}

ProgramOutput run_program(const std::vector<std::string>& command) {
  std::array<int, 2> out{}, error{};
  if (::pipe2(out.data(), O_CLOEXEC) != 0 || ::pipe2(error.data(), O_CLOEXEC) != 0)
    throw std::runtime_error(command[0] + ": no pipe for it");
  const pid_t process = fork_or_throw(command);
  if (process == 0) {
    ::dup2(out[1], STDOUT_FILENO);
    ::dup2(error[1], STDERR_FILENO);
    become(command);
  }
  ::close(out[1]);
  ::close(error[1]);
  ProgramOutput output;
  read_all({out[0], error[0]}, {&output.text, &output.error});
  ::close(out[0]);
  ::close(error[0]);
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  output.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return output;
}

std::string shell_word(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

bool is_installed(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (::access((std::filesystem::path(folder) / program).c_str(), X_OK) == 0) return true;
  }
  return false;
}

}  // namespace roadfix
