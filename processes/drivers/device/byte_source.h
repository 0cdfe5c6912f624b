/// Where a driver's bytes come from: a serial port, a TCP server, a file, a pseudo-terminal, a CAN interface. The only
/// part of a driver that does I/O.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace roadfix {

/// A device that cannot be opened; the text says why.
struct SourceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What one read gave.
struct Packet {
  int stream = 0;     ///< of a source with several (two cameras)
  int64_t utime = 0;  ///< when it was read; 0: when read() returned
  std::vector<uint8_t> bytes;
};

enum class ReadState {
  kData,
  kNothing,  ///< the timeout is over
  kEnd,      ///< a file is over: nothing will ever come again
  kLost      ///< the device went away; opening it again may help
};

class ByteSource {
 public:
  virtual ~ByteSource() = default;

  /// Waits up to `timeout` for bytes and appends what is there.
  virtual ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) = 0;

  /// Bytes for the device (corrections); false where it takes none, or not all of them.
  virtual bool write(std::span<const uint8_t> bytes) {
    (void)bytes;
    return false;
  }

  /// The name under which it can be found, for example that of a pseudo-terminal.
  [[nodiscard]] virtual std::string name() const = 0;
};

struct DeviceConfig {
  /// "/dev/ttyACM0"; "tcp:HOST:PORT"; "file:PATH", raw bytes at `rate`; "pty:", a pseudo-terminal of our own;
  /// "can:can0"; "candump:PATH", lines of candump -L at the pace of their stamps.
  std::string device;
  int baud = 115200;           ///< of a serial port
  double file_rate = 11520.0;  ///< bytes/s of "file:"; 0: at once
  double silence = 3.0;        ///< s without a byte after which the heartbeat says so
  double reopen_first = 0.2;   ///< s before the first attempt to open a lost device again; doubles
  double reopen_max = 5.0;     ///< s
};

template <class Visitor>
void visit(DeviceConfig& c, Visitor& v) {
  v.require("device");
  v.text("device", c.device);
  v.integer("baud", c.baud, 1200, 4'000'000);
  v.number("file_rate_bytes_per_s", c.file_rate, 0.0, 1e9);
  v.number("silence_s", c.silence, 0.01, 3600.0);
  v.number("reopen_first_s", c.reopen_first, 0.001, 60.0);
  v.number("reopen_max_s", c.reopen_max, 0.001, 600.0);
}

/// Throws SourceError; std::invalid_argument where the configuration itself is wrong (no such baud rate).
std::unique_ptr<ByteSource> open_byte_source(const DeviceConfig& config);

/// What several kinds share: a descriptor that is waited for and read without blocking, closed at the end.
class DescriptorSource : public ByteSource {
 public:
  DescriptorSource(int descriptor, std::string name) : descriptor_(descriptor), name_(std::move(name)) {}
  ~DescriptorSource() override;
  DescriptorSource(const DescriptorSource&) = delete;
  DescriptorSource& operator=(const DescriptorSource&) = delete;

  ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) override;
  bool write(std::span<const uint8_t> bytes) override;
  [[nodiscard]] std::string name() const override { return name_; }

 protected:
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
  std::string name_;
};

std::unique_ptr<ByteSource> open_serial(const std::string& path, int baud);
std::unique_ptr<ByteSource> open_tcp(const std::string& host, const std::string& port);
std::unique_ptr<ByteSource> open_file(const std::string& path, double bytes_per_s);
std::unique_ptr<ByteSource> open_pty();
std::unique_ptr<ByteSource> open_can(const std::string& interface);
/// Of a socket that is open and gives one struct can_frame or canfd_frame with each read; closes it at the end.
std::unique_ptr<ByteSource> can_source(int descriptor, const std::string& interface);
std::unique_ptr<ByteSource> open_candump(const std::string& path);

}  // namespace roadfix
