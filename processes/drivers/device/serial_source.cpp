// Serial ports and pseudo-terminals.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "drivers/device/byte_source.h"
#include "drivers/device/serial_port.h"

namespace roadfix {

namespace {

constexpr std::array<std::pair<int, speed_t>, 16> kSpeeds = {{{1200, B1200},
                                                              {2400, B2400},
                                                              {4800, B4800},
                                                              {9600, B9600},
                                                              {19200, B19200},
                                                              {38400, B38400},
                                                              {57600, B57600},
                                                              {115200, B115200},
                                                              {230400, B230400},
                                                              {460800, B460800},
                                                              {500000, B500000},
                                                              {921600, B921600},
                                                              {1000000, B1000000},
                                                              {2000000, B2000000},
                                                              {3000000, B3000000},
                                                              {4000000, B4000000}}};

speed_t speed_of(int baud) {
  std::string all;
  for (const auto& [rate, speed] : kSpeeds) {
    if (rate == baud) return speed;
    all += " " + std::to_string(rate);
  }
  throw std::invalid_argument("baud = " + std::to_string(baud) + ": no such rate; there are" + all);
}

/// Bytes as they are: no echo, no line editing, no translation of line ends.
void make_raw(int descriptor, speed_t speed, const std::string& name) {
  termios settings{};
  if (::tcgetattr(descriptor, &settings) != 0) throw SourceError(name + ": is no serial port");
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS | CSTOPB);
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  if (::cfsetspeed(&settings, speed) != 0 || ::tcsetattr(descriptor, TCSANOW, &settings) != 0) {
    throw SourceError(name + ": " + std::strerror(errno));
  }
}

/// Ours from both ends, so that it lives as long as the source, whoever opens and closes it outside.
class PtySource : public DescriptorSource {
 public:
  PtySource(int main, int end, std::string name) : DescriptorSource(main, std::move(name)), end_(end) {}
  ~PtySource() override { ::close(end_); }
  PtySource(const PtySource&) = delete;
  PtySource& operator=(const PtySource&) = delete;

 private:
  int end_;
};

class SerialSource : public DescriptorSource {
 public:
  using DescriptorSource::DescriptorSource;
  ~SerialSource() override { ::ioctl(descriptor(), TIOCNXCL); }
  SerialSource(const SerialSource&) = delete;
  SerialSource& operator=(const SerialSource&) = delete;
};

/// Two readers would share the bytes between them. The lock goes with its holder, however that ends. TIOCEXCL shuts out
/// programs that ask for no lock, but it stays with the terminal until the last one has closed it: a pseudo-terminal,
/// whose other end stays open, would be shut to us as well when we were killed.
void lock_exclusively(int descriptor, const std::string& name) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) throw SourceError(name + ": another program reads it");
  struct stat status {};
  constexpr unsigned kFirstPty = 136, kLastPty = 143;  // Linux, Documentation/admin-guide/devices.txt
  if (::fstat(descriptor, &status) != 0) throw SourceError(name + ": " + std::strerror(errno));
  const bool pty = major(status.st_rdev) >= kFirstPty && major(status.st_rdev) <= kLastPty;
  if (!pty) ::ioctl(descriptor, TIOCEXCL);
}

}  // namespace

int open_serial_port(const std::string& path, int baud) {
  const speed_t speed = speed_of(baud);
  const int descriptor = ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) throw SourceError(path + ": " + std::strerror(errno));
  try {
    make_raw(descriptor, speed, path);
    lock_exclusively(descriptor, path);
  } catch (...) {
    ::close(descriptor);
    throw;
  }
  ::tcflush(descriptor, TCIFLUSH);
  return descriptor;
}

std::unique_ptr<ByteSource> open_serial(const std::string& path, int baud) {
  return std::make_unique<SerialSource>(open_serial_port(path, baud), path);
}

Pty open_pty_ends() {
  const int main = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (main < 0 || ::grantpt(main) != 0 || ::unlockpt(main) != 0) {
    if (main >= 0) ::close(main);
    throw SourceError(std::string("pty: ") + std::strerror(errno));
  }
  const std::string name = ::ptsname(main);
  const int end = ::open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  try {
    make_raw(end, B115200, name);
  } catch (...) {
    ::close(main);
    if (end >= 0) ::close(end);
    throw;
  }
  return {main, end, name};
}

std::unique_ptr<ByteSource> open_pty() {
  const Pty pty = open_pty_ends();
  return std::make_unique<PtySource>(pty.main, pty.end, pty.name);
}

}  // namespace roadfix
