#include "bus/run/service.h"

#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace roadfix {

namespace {

/// The number in an environment variable; 0 where there is none.
int64_t number_in(const char* variable) {
  const char* text = std::getenv(variable);
  int64_t value = 0;
  if (text != nullptr) std::from_chars(text, text + std::strlen(text), value);
  return value;
}

}  // namespace

ServiceNotifier::ServiceNotifier() {
  const char* name = std::getenv("NOTIFY_SOCKET");
  if (name == nullptr || (name[0] != '/' && name[0] != '@') || std::strlen(name) >= sizeof(sockaddr_un::sun_path))
    return;
  address_ = name;
  if (address_[0] == '@') address_[0] = '\0';  // a name that is no file
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int64_t watchdog_pid = number_in("WATCHDOG_PID");
  if (watchdog_pid != 0 && watchdog_pid != ::getpid()) return;
  period_ = std::chrono::microseconds(number_in("WATCHDOG_USEC") / 4);
}

ServiceNotifier::~ServiceNotifier() {
  if (socket_ >= 0) ::close(socket_);
}

/// A manager that is gone is no reason to stop: the drive goes on.
void ServiceNotifier::send(const std::string& text) {
  if (socket_ < 0) return;
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  static_cast<void>(::sendto(socket_, text.data(), text.size(), MSG_NOSIGNAL, reinterpret_cast<sockaddr*>(&to), size));
}

void ServiceNotifier::ready(const std::string& status) { send("READY=1\nSTATUS=" + status); }

void ServiceNotifier::alive() {
  const auto now = std::chrono::steady_clock::now();
  if (period_ <= period_.zero() || now < due_) return;
  due_ = now + period_;
  send("WATCHDOG=1");
}

void ServiceNotifier::stopping() { send("STOPPING=1"); }

void release_free_memory() {
  constexpr int kLarge_bytes = 16 << 10;
  constexpr int kHeaps = 2;
  ::mallopt(M_MMAP_THRESHOLD, kLarge_bytes);
  ::mallopt(M_ARENA_MAX, kHeaps);
}

void make_realtime(int priority) {
  sched_param wanted{};
  wanted.sched_priority = priority;
  if (::sched_setscheduler(0, SCHED_FIFO, &wanted) != 0) {
    throw std::runtime_error("--realtime " + std::to_string(priority) + ": " + std::strerror(errno) +
                             " (allow it: LimitRTPRIO= in the unit, or 'ulimit -r' in /etc/security/limits.conf)");
  }
  if (::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    throw std::runtime_error(std::string("--realtime: memory cannot be locked: ") + std::strerror(errno) +
                             " (allow it: LimitMEMLOCK=infinity in the unit, or 'ulimit -l unlimited')");
  }
}

bool may_be_realtime(int priority) {
  const pid_t pid = ::fork();
  if (pid == 0) {
    try {
      make_realtime(priority);
      ::_exit(0);
    } catch (const std::runtime_error&) {
      ::_exit(1);
    }
  }
  int status = 1;
  return pid > 0 && ::waitpid(pid, &status, 0) == pid && status == 0;
}

}  // namespace roadfix
