#include "drivers/device/byte_source.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace roadfix {

namespace {
constexpr std::size_t kReadBytes = 4096;
/// A device that does not take its corrections within this is not waited for.
constexpr int kWriteTimeout_ms = 50;
}  // namespace

std::unique_ptr<ByteSource> open_byte_source(const DeviceConfig& config) {
  const std::string& device = config.device;
  const auto behind = [&](const char* prefix) { return device.substr(std::strlen(prefix)); };
  if (device.starts_with("tcp:")) {
    const std::string address = behind("tcp:");
    const std::size_t colon = address.rfind(':');
    if (colon == std::string::npos) throw std::invalid_argument("device '" + device + "': no port (tcp:HOST:PORT)");
    return open_tcp(address.substr(0, colon), address.substr(colon + 1));
  }
  if (device.starts_with("file:")) return open_file(behind("file:"), config.file_rate);
  if (device.starts_with("candump:")) return open_candump(behind("candump:"));
  if (device.starts_with("can:")) return open_can(behind("can:"));
  if (device == "pty:") return open_pty();
  if (device.starts_with("/")) return open_serial(device, config.baud);
  throw std::invalid_argument("device '" + device +
                              "': neither a path nor tcp:HOST:PORT, file:PATH, pty:, can:INTERFACE, candump:PATH");
}

DescriptorSource::~DescriptorSource() { ::close(descriptor_); }

ReadState DescriptorSource::read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) {
  pollfd wait{descriptor_, POLLIN, 0};
  const int ready = ::poll(&wait, 1, static_cast<int>(timeout.count()));
  if (ready == 0 || (ready < 0 && errno == EINTR)) return ReadState::kNothing;
  std::array<uint8_t, kReadBytes> buffer;
  const ssize_t size = ::read(descriptor_, buffer.data(), buffer.size());
  if (size < 0 && (errno == EAGAIN || errno == EINTR)) return ReadState::kNothing;
  if (size <= 0) return ReadState::kLost;
  packets.push_back({0, 0, {buffer.begin(), buffer.begin() + size}});
  return ReadState::kData;
}

bool DescriptorSource::write(std::span<const uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t size = ::write(descriptor_, bytes.data(), bytes.size());
    if (size > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(size));
      continue;
    }
    pollfd wait{descriptor_, POLLOUT, 0};
    if (errno != EAGAIN || ::poll(&wait, 1, kWriteTimeout_ms) <= 0) return false;
  }
  return true;
}

}  // namespace roadfix
