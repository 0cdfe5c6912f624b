/// What a driver is: a function from the bytes of a device, with the times at which they were read, to messages. Live,
/// the bytes come from the device and go out as RAW_<DEVICE> beside the messages; a replay takes them from a log. The
/// driver cannot distinguish them, and gives the same messages, byte for byte.
#pragma once

#include <functional>
#include <map>
#include <memory>

#include "bus/types/message.h"
#include "drivers/device/byte_source.h"

namespace roadfix {

/// Where a driver puts its messages: numbers them, and lets time on a channel only go forward.
class SensorOutputs {
 public:
  virtual ~SensorOutputs() = default;

  /// A new run of the driver: counting begins anew.
  void begin(int64_t run) {
    run_ = run;
    channels_.clear();
  }

  /// Fills run and seq and sends. False where utime is not later than that of the message before.
  template <class T>
  bool publish(const std::string& channel, T& message) {
    Channel& state = channels_[channel];
    if (state.seq > 0 && message.utime <= state.newest_utime) return false;
    state.newest_utime = message.utime;
    message.run = run_;
    message.seq = state.seq++;
    encode_into(message, buffer_);
    send(channel, message.utime, buffer_);
    return true;
  }

 protected:
  virtual void send(const std::string& channel, int64_t utime, std::span<const uint8_t> bytes) = 0;

 private:
  struct Channel {
    int64_t seq = 0;
    int64_t newest_utime = 0;
  };

  int64_t run_ = 0;
  std::map<std::string, Channel> channels_;
  std::vector<uint8_t> buffer_;
};

/// What became of the bytes: one row of the heartbeat.
struct StreamCounters {
  std::string name;           ///< for example "UBX" or "GNSS"
  int64_t received = 0;       ///< whole frames
  int64_t used = 0;           ///< that became part of a message
  int64_t bad_checksum = 0;   ///<
  int64_t refused = 0;        ///< whole, but with contents that cannot be used
  int64_t late = 0;           ///< not later than what was published before
  int64_t skipped_bytes = 0;  ///< that belong to no frame
  int64_t newest_utime = 0;   ///< of what was published
  bool operator==(const StreamCounters&) const = default;
};

class SensorDriver {
 public:
  virtual ~SensorDriver() = default;

  /// The device was opened (again): what comes now does not continue what came before.
  virtual void opened(int stream) = 0;
  virtual void take(int stream, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) = 0;
  [[nodiscard]] virtual std::vector<StreamCounters> counters() const = 0;
  /// What the device itself reports as wrong, as text; empty where nothing is.
  [[nodiscard]] virtual std::string state_reason(int64_t now_utime) const {
    (void)now_utime;
    return {};
  }
};

/// What a driver asks of the world beside reading: corrections from the network, sent to the device.
class Companion {
 public:
  virtual ~Companion() = default;
  /// Called about every 50 ms; does not wait. `device` may be null.
  virtual void step(int64_t now_utime, const SensorDriver& driver, ByteSource* device) = 0;
  /// As text; empty where nothing is wrong.
  [[nodiscard]] virtual std::string state_reason() const = 0;
  /// What came from the network since the last call, for RAW_<raw_channel()>.
  [[nodiscard]] virtual std::vector<uint8_t> take_received() = 0;
  [[nodiscard]] virtual std::string raw_channel() const = 0;
};

/// One driver program with its configuration read.
struct DriverSetup {
  std::string name;                       ///< for example "gnss_driver"
  std::vector<std::string> raw_channels;  ///< of stream 0, 1, ...
  bool publish_raw = true;
  std::string config;  ///< effective values, YAML
  DeviceConfig device;
  std::function<std::unique_ptr<SensorDriver>()> make;
  /// `now_utime` for sources that know better when a read happened. Throws SourceError.
  std::function<std::unique_ptr<ByteSource>(const std::function<int64_t()>& now_utime)> open;
  std::function<std::unique_ptr<Companion>()> make_companion;  ///< may be empty
};

/// Feeds raw messages to a driver in order: a new run makes a new driver, an empty message says that the device was
/// opened, and after a lost one nothing continues.
class RawReader {
 public:
  RawReader(const DriverSetup& setup, SensorOutputs& outputs) : setup_(setup), outputs_(outputs) {}

  void take(int stream, const Header& header, std::span<const uint8_t> bytes);

  /// Null before the first message.
  [[nodiscard]] const SensorDriver* driver() const { return driver_.get(); }
  [[nodiscard]] int64_t lost() const { return lost_; }

 private:
  const DriverSetup& setup_;
  SensorOutputs& outputs_;
  std::unique_ptr<SensorDriver> driver_;
  int64_t run_ = 0;
  std::map<int, int64_t> next_seq_;
  int64_t lost_ = 0;
};

}  // namespace roadfix
