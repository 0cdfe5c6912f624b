#include "pose_server/outlets.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>

#include "pose_server/sentence_queue.h"
#include "pose_server/socket_address.h"

namespace roadfix {
namespace {

using Catch::Contains;
using Clock = SentenceQueue::Clock;

std::string sentence(int i) { return "$GNHDT," + std::to_string(100000 + i) + ",T*00\r\n"; }

struct Pair {
  Pair() {
    std::array<int, 2> ends{};
    REQUIRE(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()) == 0);
    ours = Descriptor(ends[0]);
    theirs = Descriptor(ends[1]);
  }
  std::string read_all() const {
    std::string out;
    std::array<char, 4096> buffer{};
    for (ssize_t n = 0; (n = ::recv(theirs.get(), buffer.data(), buffer.size(), MSG_DONTWAIT)) > 0;)
      out.append(buffer.data(), static_cast<std::size_t>(n));
    return out;
  }
  Descriptor ours, theirs;
};

TEST_CASE("sentence queue: a slow reader gets fewer sentences, each whole and in order") {
  Pair pair;
  SentenceQueue queue(200);
  std::string got;
  for (int i = 0; i < 50'000; ++i) {
    queue.add(sentence(i));
    REQUIRE(queue.flush(pair.ours.get(), Clock::now()));
    if (i % 7'000 == 0) got += pair.read_all();
  }
  got += pair.read_all();
  while (!queue.empty()) {
    REQUIRE(queue.flush(pair.ours.get(), Clock::now()));
    got += pair.read_all();
  }
  const std::size_t length = sentence(0).size();
  REQUIRE(got.size() % length == 0);
  CHECK(queue.left_out() > 0);
  CHECK(got.size() / length + static_cast<std::size_t>(queue.left_out()) == 50'000);
  std::string last;
  for (std::size_t i = 0; i < got.size(); i += length) {
    const std::string line = got.substr(i, length);
    REQUIRE(line.starts_with("$GNHDT,"));
    REQUIRE(line.ends_with("\r\n"));
    REQUIRE(line > last);
    last = line;
  }
}

TEST_CASE("sentence queue: of several sentences those that fit are kept") {
  SentenceQueue queue(2 * sentence(1).size() - 1);
  queue.add(sentence(1) + sentence(2) + sentence(3));
  CHECK(queue.left_out() == 2);
}

TEST_CASE("sentence queue: how long it is stuck, and when its reader is gone") {
  Pair pair;
  SentenceQueue queue(1 << 20);
  const Clock::time_point start = Clock::now();
  std::string long_one(900'000, 'x');
  long_one.push_back('\n');
  queue.add(long_one);
  REQUIRE(queue.flush(pair.ours.get(), start));
  REQUIRE_FALSE(queue.empty());
  CHECK(queue.stuck(start + std::chrono::seconds(3)) == std::chrono::seconds(3));
  CHECK_FALSE(pair.read_all().empty());
  REQUIRE(queue.flush(pair.ours.get(), start + std::chrono::seconds(4)));
  CHECK(queue.stuck(start + std::chrono::seconds(5)) == std::chrono::seconds(1));
  pair.theirs = Descriptor();
  CHECK_FALSE(queue.flush(pair.ours.get(), start));
}

TEST_CASE("outlets: addresses that are none are told with their key") {
  for (const char* text : {"", "127.0.0.1", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:70000", "127.0.0.1:1 ", ":::"}) {
    CHECK_THROWS_WITH(socket_address("tcp", text), Contains("tcp: '" + std::string(text) + "'"));
  }
  CHECK_THROWS_WITH(socket_address("udp", "localhost:1"), Contains("names are not looked up"));
  CHECK(socket_address("udp", "[::1]:10110").storage.ss_family == AF_INET6);
  CHECK_THROWS_WITH(open_serial_outlet("/dev/null", 115200), Contains("serial: /dev/null"));
  CHECK_THROWS_WITH(open_serial_outlet("pty:nonsense", 115200), Contains("pty:nonsense"));
  CHECK_THROWS_WITH(open_serial_outlet("/dev/null", 12345), Contains("12345"));
  PoseServerConfig nowhere;
  nowhere.tcp.clear();
  CHECK_THROWS_WITH(open_outlets(nowhere), Contains("neither tcp, udp nor serial"));
}

TEST_CASE("outlets: a pseudo-terminal gives the present to who opens it late") {
  const std::unique_ptr<Outlet> outlet = open_serial_outlet("pty:", 115200);
  const std::string name = outlet->name().substr(std::string("serial ").size());
  Clock::time_point now = Clock::now();
  const int last = 5'000;  // 100 kB: far more than a terminal holds
  for (int i = 0; i < last; ++i) {
    now += std::chrono::milliseconds(10);
    outlet->send(sentence(i), now);
    outlet->step(now);
  }
  const Descriptor reader(::open(name.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK));
  REQUIRE(reader.open());
  std::string got;
  std::array<char, 4096> buffer{};
  const auto read_all = [&] {
    for (ssize_t n = 0; (n = ::read(reader.get(), buffer.data(), buffer.size())) > 0;)
      got.append(buffer.data(), static_cast<std::size_t>(n));
  };
  read_all();
  for (int i = last; i < last + 100; ++i) {
    now += std::chrono::milliseconds(10);
    outlet->send(sentence(i), now);
    read_all();
  }
  CHECK(got.find(sentence(last - 1'000)) == std::string::npos);  // ten seconds old
  CHECK(got.find(sentence(last + 50)) != std::string::npos);
  CHECK(got.ends_with(sentence(last + 99)));
  CHECK(outlet->state_reason().empty());
}

}  // namespace
}  // namespace roadfix
