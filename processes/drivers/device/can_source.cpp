// SocketCAN (Linux, Documentation/networking/can.rst), as lines of candump with the kernel's time of reception.
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/device/byte_source.h"
#include "drivers/protocols/candump.h"

namespace roadfix {

namespace {

/// Frames handed over at once.
constexpr int kFramesAtOnce = 64;

CanFrame from_kernel(const canfd_frame& sent, int64_t t_us) {
  CanFrame frame;
  frame.t_us = t_us;
  frame.error = (sent.can_id & CAN_ERR_FLAG) != 0;
  frame.extended = frame.error || (sent.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (sent.can_id & CAN_RTR_FLAG) != 0;
  frame.id = sent.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.size = static_cast<uint8_t>(std::min<std::size_t>(sent.len, frame.data.size()));
  std::copy(sent.data, sent.data + frame.size, frame.data.begin());
  return frame;
}

class CanSource : public DescriptorSource {
 public:
  CanSource(int descriptor, std::string interface)
      : DescriptorSource(descriptor, "can:" + interface), interface_(std::move(interface)) {}

  ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) override {
    pollfd wait{descriptor(), POLLIN, 0};
    const int ready = ::poll(&wait, 1, static_cast<int>(timeout.count()));
    if (ready == 0 || (ready < 0 && errno == EINTR)) return ReadState::kNothing;
    Packet packet;
    for (int i = 0; i < kFramesAtOnce; ++i) {
      CanFrame frame;
      const int got = receive(frame);
      if (got < 0) return ReadState::kLost;
      if (got == 0) break;
      const std::string line = can_line(frame, interface_);
      packet.bytes.insert(packet.bytes.end(), line.begin(), line.end());
    }
    if (packet.bytes.empty()) return ReadState::kNothing;
    packets.push_back(std::move(packet));
    return ReadState::kData;
  }

 private:
  /// 1 with a frame, 0 where none waits, -1 where the interface went down.
  int receive(CanFrame& frame) {
    canfd_frame sent{};
    iovec part{&sent, sizeof sent};
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timeval))];
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof control;
    const ssize_t size = ::recvmsg(descriptor(), &message, MSG_DONTWAIT);
    if (size < 0) return errno == EAGAIN || errno == EINTR ? 0 : -1;
    if (size == 0) return -1;
    if (size != static_cast<ssize_t>(CAN_MTU) && size != static_cast<ssize_t>(CANFD_MTU)) return 0;
    timeval stamp{};
    for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr; header = CMSG_NXTHDR(&message, header)) {
      if (header->cmsg_level == SOL_SOCKET && header->cmsg_type == SO_TIMESTAMP) {
        std::memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
      }
    }
    frame = from_kernel(sent, int64_t{stamp.tv_sec} * 1'000'000 + stamp.tv_usec);
    return 1;
  }

  std::string interface_;
};

}  // namespace

std::unique_ptr<ByteSource> can_source(int descriptor, const std::string& interface) {
  const int on = 1;
  ::setsockopt(descriptor, SOL_SOCKET, SO_TIMESTAMP, &on, sizeof on);
  return std::make_unique<CanSource>(descriptor, interface);
}

std::unique_ptr<ByteSource> open_can(const std::string& interface) {
  const std::string name = "can:" + interface;
  const int descriptor = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  if (descriptor < 0) throw SourceError(name + ": this kernel has no SocketCAN (" + std::strerror(errno) + ")");
  auto source = can_source(descriptor, interface);
  ifreq request{};
  interface.copy(request.ifr_name, IFNAMSIZ - 1);
  if (::ioctl(descriptor, SIOCGIFINDEX, &request) != 0) {
    throw SourceError(name + ": no such interface (ip link set " + interface + " up type can bitrate 500000)");
  }
  const int on = 1;
  ::setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (::bind(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    throw SourceError(name + ": " + std::strerror(errno));
  }
  return source;
}

}  // namespace roadfix
