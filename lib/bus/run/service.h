/// What a process owes to the service manager that started it, and to the scheduler: heartbeats from its message
/// loop, and real time where it is asked for.
#pragma once

#include <chrono>
#include <string>

namespace roadfix {

/// systemd's notification protocol (sd_notify(3)): datagrams to the socket that $NOTIFY_SOCKET names, so libsystemd is
/// not needed. Without that variable nothing happens.
class ServiceNotifier {
 public:
  /// Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID of the environment.
  ServiceNotifier();
  ~ServiceNotifier();
  ServiceNotifier(const ServiceNotifier&) = delete;
  ServiceNotifier& operator=(const ServiceNotifier&) = delete;

  /// Bus and configuration are there: what waits for this process may start.
  void ready(const std::string& status);
  /// From the message loop, each time around: feeds the watchdog, at most four times within its time-out.
  void alive();
  void stopping();

 private:
  void send(const std::string& text);

  int socket_ = -1;
  std::string address_;
  std::chrono::steady_clock::duration period_{};  ///< between two heartbeats; 0: nobody waits for them
  std::chrono::steady_clock::time_point due_{};
};

/// Makes the C library give large buffers back at once. By itself it learns from the first snapshot of a megabyte to
/// keep such buffers in the heap, where the small messages between them hold the rest for ever.
void release_free_memory();

/// SCHED_FIFO at `priority` (1 to 99) for this thread and those it will start, and memory that is never paged out.
/// Throws std::runtime_error that names what allows it. Other processes wait while this one runs: on request only.
void make_realtime(int priority);

/// Whether make_realtime() would do it; tried in a process of its own. For programs without threads.
[[nodiscard]] bool may_be_realtime(int priority);

}  // namespace roadfix
