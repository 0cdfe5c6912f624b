#include "roadfix/fleet/task_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>

#include "config/config_error.h"

namespace roadfix {

TaskLock::TaskLock(const std::filesystem::path& path) {
  fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd_ < 0) throw ConfigError(path.string(), 0, std::string("cannot be made: ") + std::strerror(errno));
  held_ = ::flock(fd_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

TaskLock::~TaskLock() { ::close(fd_); }

void TaskLock::sign() const {
  const std::string text = fmt::format("{}, process {}, since {}\n", host_name(), ::getpid(), utc_now());
  if (::ftruncate(fd_, 0) != 0 || ::pwrite(fd_, text.data(), text.size(), 0) < 0) return;  // it locks all the same
}

void TaskLock::unsign() const {
  if (::ftruncate(fd_, 0) != 0) return;  // then it says who was interrupted
}

std::string TaskLock::signature(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return "";
  std::string text = read_text_file(path);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

bool TaskLock::is_taken(const std::filesystem::path& path) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) return false;
  const bool taken = ::flock(fd, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(fd);
  return taken;
}

std::string host_name() {
  char name[256] = {};
  ::gethostname(name, sizeof name - 1);
  return name;
}

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  char text[32] = {};
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

}  // namespace roadfix
