#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>

#include "pose_server/outlets.h"
#include "pose_server/sentence_queue.h"
#include "pose_server/socket_address.h"

namespace roadfix {

namespace {

/// What waits for a slow client, here and in the kernel: about ten seconds of sentences each. More would only be older.
constexpr std::size_t kMostWaiting = 16'384;
constexpr int kSendBuffer = 8'192;

Descriptor open_socket(const SocketAddress& address, int type, const std::string& name) {
  Descriptor socket(::socket(address.get()->sa_family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket.open()) throw OutletError(name + ": " + std::strerror(errno));
  return socket;
}

class TcpOutlet final : public Outlet {
 public:
  TcpOutlet(const std::string& text, int most, double timeout_s)
      : address_(text),
        most_(static_cast<std::size_t>(most)),
        timeout_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout_s))) {
    const SocketAddress address = socket_address("tcp", text);
    listener_ = open_socket(address, SOCK_STREAM, name());
    const int yes = 1;
    ::setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (::bind(listener_.get(), address.get(), address.size) != 0 || ::listen(listener_.get(), SOMAXCONN) != 0) {
      throw OutletError(name() + ": " + std::strerror(errno));
    }
    address_ = bound_address();
  }

  void send(std::string_view sentences, Clock::time_point now) override {
    for (Client& client : clients_) client.queue.add(sentences);
    flush(now);
  }

  void step(Clock::time_point now) override {
    accept_waiting();
    for (Client& client : clients_) client.gone = client.gone || !still_there(client.socket.get());
    flush(now);
  }

  [[nodiscard]] std::string name() const override { return "tcp " + address_; }
  [[nodiscard]] std::string state_reason() const override {
    return turned_away_ ? fmt::format("{} has no room for more than {} clients", name(), most_) : std::string();
  }

 private:
  struct Client {
    Descriptor socket;
    SentenceQueue queue{kMostWaiting};
    bool gone = false;
  };

  void accept_waiting() {
    turned_away_ = turned_away_ && clients_.size() >= most_;
    for (;;) {
      Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (!socket.open()) return;
      if (clients_.size() >= most_) {
        turned_away_ = true;
        continue;
      }
      const int yes = 1;
      ::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
      ::setsockopt(socket.get(), SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer);
      clients_.push_back({std::move(socket)});
    }
  }

  /// What a client says is read and thrown away: it would fill the kernel's buffer.
  static bool still_there(int socket) {
    std::array<char, 512> nothing;
    for (int i = 0; i < 8; ++i) {
      const ssize_t size = ::recv(socket, nothing.data(), nothing.size(), MSG_DONTWAIT);
      if (size == 0) return false;
      if (size < 0) return errno == EAGAIN || errno == EINTR;
    }
    return true;
  }

  void flush(Clock::time_point now) {
    for (Client& client : clients_) {
      client.gone = client.gone || !client.queue.flush(client.socket.get(), now) || client.queue.stuck(now) > timeout_;
    }
    std::erase_if(clients_, [](const Client& client) { return client.gone; });
  }

  /// With the port that the system chose where 0 was asked for.
  [[nodiscard]] std::string bound_address() const {
    SocketAddress bound;
    bound.size = sizeof bound.storage;
    std::array<char, INET6_ADDRSTRLEN> text{};
    if (::getsockname(listener_.get(), reinterpret_cast<sockaddr*>(&bound.storage), &bound.size) != 0) return address_;
    if (bound.storage.ss_family == AF_INET6) {
      const auto* v6 = reinterpret_cast<const sockaddr_in6*>(&bound.storage);
      ::inet_ntop(AF_INET6, &v6->sin6_addr, text.data(), text.size());
      return fmt::format("[{}]:{}", text.data(), ntohs(v6->sin6_port));
    }
    const auto* v4 = reinterpret_cast<const sockaddr_in*>(&bound.storage);
    ::inet_ntop(AF_INET, &v4->sin_addr, text.data(), text.size());
    return fmt::format("{}:{}", text.data(), ntohs(v4->sin_port));
  }

  std::string address_;
  std::size_t most_;
  Clock::duration timeout_;
  Descriptor listener_;
  std::vector<Client> clients_;
  bool turned_away_ = false;
};

class UdpOutlet final : public Outlet {
 public:
  explicit UdpOutlet(const std::string& text)
      : text_(text), address_(socket_address("udp", text)), socket_(open_socket(address_, SOCK_DGRAM, "udp " + text)) {}

  void send(std::string_view sentences, Clock::time_point) override {
    const ssize_t size = ::sendto(socket_.get(), sentences.data(), sentences.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                                  address_.get(), address_.size);
    // On loopback a receiver that is not there is refused; it may come yet.
    refused_ = size < 0 && errno != ECONNREFUSED && errno != EAGAIN ? std::strerror(errno) : "";
  }
  void step(Clock::time_point) override {}
  [[nodiscard]] std::string name() const override { return "udp " + text_; }
  [[nodiscard]] std::string state_reason() const override {
    return refused_.empty() ? refused_ : name() + ": " + refused_;
  }

 private:
  std::string text_;
  SocketAddress address_;
  Descriptor socket_;
  std::string refused_;
};

}  // namespace

Descriptor::~Descriptor() {
  if (open()) ::close(number_);
}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  if (this != &other) {
    if (open()) ::close(number_);
    number_ = other.release();
  }
  return *this;
}

int Descriptor::release() {
  const int number = number_;
  number_ = -1;
  return number;
}

SocketAddress socket_address(const std::string& what, const std::string& text) {
  const std::size_t colon = text.rfind(':');
  std::string host = text.substr(0, colon == std::string::npos ? text.size() : colon);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  uint16_t port = 0;
  const char* end = text.data() + text.size();
  const auto parsed = colon == std::string::npos ? std::from_chars_result{text.data(), std::errc::invalid_argument}
                                                 : std::from_chars(text.data() + colon + 1, end, port);
  if (parsed.ec != std::errc() || parsed.ptr != end) throw OutletError(what + ": '" + text + "' is no address:port");
  SocketAddress address;
  auto* v4 = reinterpret_cast<sockaddr_in*>(&address.storage);
  auto* v6 = reinterpret_cast<sockaddr_in6*>(&address.storage);
  if (::inet_pton(AF_INET, host.c_str(), &v4->sin_addr) == 1) {
    v4->sin_family = AF_INET;
    v4->sin_port = htons(port);
    address.size = sizeof *v4;
  } else if (::inet_pton(AF_INET6, host.c_str(), &v6->sin6_addr) == 1) {
    v6->sin6_family = AF_INET6;
    v6->sin6_port = htons(port);
    address.size = sizeof *v6;
  } else {
    throw OutletError(what + ": '" + host + "' is no address; names are not looked up (127.0.0.1 for this machine)");
  }
  return address;
}

std::unique_ptr<Outlet> listen_tcp(const std::string& address, int most, double timeout_s) {
  return std::make_unique<TcpOutlet>(address, most, timeout_s);
}

std::unique_ptr<Outlet> send_udp(const std::string& address) { return std::make_unique<UdpOutlet>(address); }

}  // namespace roadfix
