#include "drivers/device/tcp_source.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace roadfix {

namespace {

constexpr int kConnectTimeout_ms = 1000;
constexpr auto kSilence = std::chrono::seconds(10);

/// A descriptor, or the negative errno.
int connect_to(const addrinfo& address) {
  const int descriptor =
      ::socket(address.ai_family, address.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, address.ai_protocol);
  if (descriptor < 0) return -errno;
  int error = ::connect(descriptor, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
  if (error == EINPROGRESS) {
    pollfd wait{descriptor, POLLOUT, 0};
    socklen_t size = sizeof error;
    error = ETIMEDOUT;
    if (::poll(&wait, 1, kConnectTimeout_ms) > 0) ::getsockopt(descriptor, SOL_SOCKET, SO_ERROR, &error, &size);
  }
  if (error == 0) return descriptor;
  ::close(descriptor);
  return -error;
}

int connect_to(const std::string& host, const std::string& port) {
  const std::string name = "tcp:" + host + ":" + port;
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found); error != 0) {
    throw SourceError(name + ": " + ::gai_strerror(error));
  }
  int result = -EHOSTUNREACH;
  for (const addrinfo* address = found; address != nullptr && result < 0; address = address->ai_next) {
    result = connect_to(*address);
  }
  ::freeaddrinfo(found);
  if (result < 0) throw SourceError(name + ": " + std::strerror(-result));
  const int on = 1;
  ::setsockopt(result, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  return result;
}

}  // namespace

TcpSource::TcpSource(const std::string& host, const std::string& port)
    : DescriptorSource(connect_to(host, port), "tcp:" + host + ":" + port),
      last_data_(std::chrono::steady_clock::now()) {}

ReadState TcpSource::read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) {
  const ReadState state = DescriptorSource::read(timeout, packets);
  const auto now = std::chrono::steady_clock::now();
  if (state == ReadState::kData) last_data_ = now;
  return state == ReadState::kNothing && now - last_data_ > kSilence ? ReadState::kLost : state;
}

std::unique_ptr<ByteSource> open_tcp(const std::string& host, const std::string& port) {
  return std::make_unique<TcpSource>(host, port);
}

}  // namespace roadfix
