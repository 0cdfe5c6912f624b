// The server on a real socket: honest, slow and hostile clients.
#include "monitor/web/server.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>

#include "monitor/web/port_holder.h"

using namespace roadfix;

namespace {

using Clock = std::chrono::steady_clock;

class Client {
 public:
  explicit Client(const std::string& url, int receive_buffer = 0) : fd_(socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer > 0) setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(std::stoi(url.substr(url.rfind(':') + 1))));
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    connected_ = connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~Client() { close(fd_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void send(const std::string& text) const { (void)::send(fd_, text.data(), text.size(), MSG_NOSIGNAL); }
  void get(const std::string& path) const { send("GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n"); }

  /// What comes until `words` stand in it or the time is up.
  std::string until(const std::string& words, int patience_ms = 60'000) {
    const auto end = Clock::now() + std::chrono::milliseconds(patience_ms);
    while (text_.find(words) == std::string::npos && Clock::now() < end) {
      pollfd fd{fd_, POLLIN, 0};
      if (poll(&fd, 1, 50) != 1) continue;
      char buffer[4096];
      const ssize_t size = recv(fd_, buffer, sizeof buffer, 0);
      if (size <= 0) {
        closed_ = true;
        break;
      }
      text_.append(buffer, static_cast<std::size_t>(size));
    }
    return text_;
  }
  [[nodiscard]] bool closed() const { return closed_; }
  [[nodiscard]] bool connected() const { return connected_; }

 private:
  int fd_;
  bool connected_ = false;
  bool closed_ = false;
  std::string text_;
};

ServerOptions any_port(int clients = 8, int patience_s = 1) {
  ServerOptions options;
  options.clients = clients;
  options.patience_s = patience_s;
  return options;
}

std::string address(const DashboardServer& server) {
  std::string url = server.url();
  url.pop_back();
  return url;
}

}  // namespace

TEST_CASE("the stream brings each new frame, and the board knows that somebody looks") {
  Board board("x", false);
  const DashboardServer server(board, any_port());
  CHECK_FALSE(board.watched());
  Client client(address(server));
  REQUIRE(client.connected());
  client.get("/live");
  CHECK_THAT(client.until("retry: 1000"), Catch::Contains("text/event-stream"));
  CHECK(board.watched());
  board.put_frame("{\"n\":1}");
  CHECK_THAT(client.until("data: {\"n\":1}"), Catch::Contains("data: {\"n\":1}\n\n"));
  board.put_frame("{\"n\":2}");
  CHECK_THAT(client.until("data: {\"n\":2}"), Catch::Contains("data: {\"n\":2}\n\n"));
}

/// Frames for a client that takes nothing and one that does: how long giving them took at most, where the stuck one was
/// dropped in the end.
Clock::duration slowest_beside_a_stuck_client() {
  Board board("x", false);
  const DashboardServer server(board, any_port());
  Client stuck(address(server), 4096);
  stuck.get("/live");
  Client lively(address(server));
  lively.get("/live");
  lively.until("retry: 1000");
  const std::string padding(100'000, 'x');
  Clock::duration slowest{};
  const auto start = Clock::now();
  for (int frames = 0; frames < 12 || Clock::now() - start < std::chrono::seconds(4); ++frames) {
    const auto before = Clock::now();
    board.put_frame("\"" + std::to_string(frames) + "-" + padding + "\"");
    slowest = std::max(slowest, Clock::now() - before);
    const std::string mark = "data: \"" + std::to_string(frames) + "-";
    CHECK(lively.until(mark).find(mark) != std::string::npos);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  stuck.until("never to be found", 3000);
  CHECK(stuck.closed());
  CHECK_FALSE(lively.closed());
  return slowest;
}

TEST_CASE("a client that takes nothing is dropped, and the others never notice") {
  // Less than the stuck client is waited for. A busy machine may hold up one try; waiting would hold up all of them.
  bool unnoticed = false;
  for (int i = 0; i < 5 && !unnoticed; ++i)
    unnoticed = slowest_beside_a_stuck_client() < std::chrono::milliseconds(900);
  CHECK(unnoticed);
}

TEST_CASE("hostile requests are refused or dropped, and the page goes on") {
  Board board("x", false);
  board.put_frame("7");
  const DashboardServer server(board, any_port());
  for (const std::string& bad :
       {std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11), std::string(60'000, 'A'),
        "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(60'000, 'B') + "\r\n\r\n",
        std::string("POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\nxxxx"),
        std::string("GET /%00%ff%2e%2e/ HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        std::string("GET /picture?t=9&t=%zz HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        std::string("GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n"),
        std::string("\r\n\r\n\0\0", 6)}) {
    Client client(address(server));
    client.send(bad);
    client.until("\r\n\r\n", 300);
  }
  Client good(address(server));
  good.get("/frame");
  CHECK_THAT(good.until("\r\n\r\n7"), Catch::Contains("200 OK"));
}

TEST_CASE("an address that is taken is told as such") {
  Board board("x", false);
  const DashboardServer first(board, any_port());
  ServerOptions same = any_port();
  same.port = std::stoi(address(first).substr(address(first).rfind(':') + 1));
  CHECK_THROWS_AS(DashboardServer(board, same), ListenError);
  const std::string us = "process " + std::to_string(::getpid());
  CHECK_THROWS_WITH(DashboardServer(board, same), Catch::Contains(us));
  CHECK_THAT(*port_holder(same.port), Catch::EndsWith(us));
}

TEST_CASE("nobody holds a port that is free") {
  int port = 0;
  {
    Board board("x", false);
    const DashboardServer server(board, any_port());
    port = std::stoi(address(server).substr(address(server).rfind(':') + 1));
    CHECK(port_holder(port));
  }
  CHECK_FALSE(port_holder(port));
}

TEST_CASE("no more connections than allowed, and idle ones make room again") {
  Board board("x", false);
  board.put_frame("7");
  const DashboardServer server(board, any_port(4));
  std::vector<std::unique_ptr<Client>> idle;
  for (int i = 0; i < 4; ++i) idle.push_back(std::make_unique<Client>(address(server)));
  for (const auto& client : idle) client->send("GET / HT");
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  Client fifth(address(server));
  fifth.get("/frame");
  CHECK_THAT(fifth.until("200 OK", 300), !Catch::Contains("200 OK"));
  bool served = false;
  for (const auto end = Clock::now() + std::chrono::seconds(60); !served && Clock::now() < end;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    Client later(address(server));
    later.get("/frame");
    served = later.until("200 OK", 300).find("200 OK") != std::string::npos;
  }
  CHECK(served);
}
