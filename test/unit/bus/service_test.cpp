#include "bus/run/service.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <thread>

#include "support/temporary_folder.h"

namespace roadfix {
namespace {

/// What systemd is to the process: a socket and three variables.
class Manager {
 public:
  explicit Manager(const std::string& name) : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, name.data(), name.size());
    if (name[0] == '@') address.sun_path[0] = '\0';
    REQUIRE(::bind(socket_, reinterpret_cast<sockaddr*>(&address),
                   static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size())) == 0);
    ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
    ::setenv("WATCHDOG_USEC", "200000", 1);
    ::setenv("WATCHDOG_PID", std::to_string(::getpid()).c_str(), 1);
  }
  ~Manager() {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(name);
    ::close(socket_);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  /// The next datagram; empty where none waits.
  [[nodiscard]] std::string heard() const {
    char text[256];
    const ssize_t size = ::recv(socket_, text, sizeof text, 0);
    return size > 0 ? std::string(text, static_cast<std::size_t>(size)) : std::string();
  }

 private:
  int socket_;
};

void check_protocol(const std::string& name) {
  const Manager manager(name);
  ServiceNotifier notifier;
  notifier.ready("running");
  CHECK(manager.heard() == "READY=1\nSTATUS=running");
  const auto fed = [&] {
    int count = 0;
    while (manager.heard() == "WATCHDOG=1") ++count;
    return count;
  };
  // A quarter of its patience of 0.2 s: with the first time around, and then every 50 ms, not with every message.
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 1000; ++i) notifier.alive();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const int first = fed();
  CHECK(first >= 1);
  CHECK(first <= 1 + static_cast<int>(took.count() / 0.05));
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  notifier.alive();
  CHECK(fed() == 1);
  notifier.stopping();
  CHECK(manager.heard() == "STOPPING=1");
}

TEST_CASE("the service manager hears READY, signs of life and STOPPING") {
  const test::TemporaryFolder folder;
  check_protocol((folder / "notify").string());
  check_protocol("@roadfix_service_test_" + std::to_string(::getpid()));
}

TEST_CASE("a watchdog of another process is not fed, and without a manager nothing happens") {
  const test::TemporaryFolder folder;
  {
    const Manager manager((folder / "notify").string());
    ::setenv("WATCHDOG_PID", "1", 1);
    ServiceNotifier notifier;
    notifier.alive();
    CHECK(manager.heard().empty());
  }
  ServiceNotifier nobody;
  nobody.ready("x");
  nobody.alive();
  nobody.stopping();
  ::setenv("NOTIFY_SOCKET", "/no/such/socket", 1);
  {
    ServiceNotifier gone;
    gone.ready("x");
  }
  ::unsetenv("NOTIFY_SOCKET");
}

TEST_CASE("a priority that does not exist is refused with what allows it") {
  CHECK_THROWS_WITH(make_realtime(1000), Catch::Contains("LimitRTPRIO"));
  CHECK_FALSE(may_be_realtime(1000));
}

}  // namespace
}  // namespace roadfix
