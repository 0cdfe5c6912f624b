#include "bus/transport/group_socket.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace roadfix {

namespace {

constexpr std::size_t kLargestDatagram = 65536;

int64_t wall_clock_us() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}

/// The kernel's stamp, where it gave one.
int64_t stamp_of(msghdr& message) {
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr; part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_TIMESTAMP) continue;
    timeval at{};
    std::memcpy(&at, CMSG_DATA(part), sizeof at);
    return int64_t{at.tv_sec} * 1'000'000 + at.tv_usec;
  }
  return wall_clock_us();
}

}  // namespace

GroupSocket::GroupSocket(const BusUrl& url, int receive_buffer_bytes) : buffer_(kLargestDatagram) {
  const auto must = [this](int result, const char* step) {
    if (result >= 0) return;
    const int error = errno;
    if (descriptor_ >= 0) ::close(descriptor_);
    throw std::system_error(error, std::generic_category(), step);
  };
  const auto set = [&](int level, int option, int value, const char* step) {
    must(::setsockopt(descriptor_, level, option, &value, sizeof value), step);
  };
  descriptor_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  must(descriptor_, "socket");
  set(SOL_SOCKET, SO_REUSEADDR, 1, "sharing the port");
  set(SOL_SOCKET, SO_RCVBUF, receive_buffer_bytes, "receive buffer");
  set(SOL_SOCKET, SO_TIMESTAMP, 1, "stamps");
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(url.port));
  ::inet_pton(AF_INET, url.group.c_str(), &address.sin_addr);
  must(::bind(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof address), "port");
  ip_mreq group{};
  group.imr_multiaddr = address.sin_addr;
  group.imr_interface.s_addr = htonl(INADDR_ANY);  // the route decides
  must(::setsockopt(descriptor_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group), "joining the group");
}

GroupSocket::~GroupSocket() { ::close(descriptor_); }

bool GroupSocket::wait(std::chrono::milliseconds patience) const {
  pollfd waits{descriptor_, POLLIN, 0};
  return ::poll(&waits, 1, static_cast<int>(patience.count())) >= 0 || errno != EINTR;
}

std::optional<Datagram> GroupSocket::receive() {
  sockaddr_in from{};
  iovec part{buffer_.data(), buffer_.size()};
  alignas(cmsghdr) std::array<uint8_t, CMSG_SPACE(sizeof(timeval))> control;
  msghdr message{};
  message.msg_name = &from;
  message.msg_namelen = sizeof from;
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = ::recvmsg(descriptor_, &message, MSG_DONTWAIT);
  if (size < 0) return std::nullopt;
  const uint64_t sender = (uint64_t{from.sin_addr.s_addr} << 16) | from.sin_port;
  return Datagram{sender, stamp_of(message), {buffer_.data(), static_cast<std::size_t>(size)}};
}

}  // namespace roadfix
