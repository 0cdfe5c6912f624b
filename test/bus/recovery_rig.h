/// Drivers under `roadfix run` on a real bus, with devices that are pseudo-terminals: what the devices sent, what came
/// out.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <map>
#include <random>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/raw_t.hpp>

#include "bus/transport/network_bus.h"
#include "support/driver_run.h"
#include "support/temporary_folder.h"

namespace roadfix::test {

using SteadyTime = std::chrono::steady_clock::time_point;

/// A serial device that keeps what it could send. What is sent while nobody reads and the port's buffer is full is
/// lost, as on a wire.
class MadeDevice {
 public:
  /// `link`: the name under which the driver finds it, a symbolic link.
  explicit MadeDevice(std::filesystem::path link) : link_(std::move(link)) { plug_in(); }
  ~MadeDevice() { unplug(); }
  MadeDevice(const MadeDevice&) = delete;
  MadeDevice& operator=(const MadeDevice&) = delete;

  void plug_in();
  void unplug();
  void send(const Bytes& bytes);
  [[nodiscard]] const Bytes& sent() const { return sent_; }

 private:
  std::filesystem::path link_;
  int main_ = -1;
  Bytes sent_;
};

/// One driver and its device.
struct DriverUnderTest {
  std::string name;         ///< of the program
  std::string channel;      ///< of its messages
  std::string raw_channel;  ///< of its bytes
  std::string protocol;     ///< the heartbeat's row that counts whole frames
  std::size_t frame_bytes = 0;
  double period_s = 0.0;  ///< between two frames
  std::function<Bytes(double t_s)> frame;
};

/// A stretch of a device's bytes that was lost for a reason, as places in what it sent.
struct ExpectedGap {
  std::size_t from = 0;
  std::size_t to = 0;
};

/// Starts `roadfix run`; ends it with Ctrl-C's signal when it goes.
class RecoveryRig {
 public:
  enum class Says { kFrames, kGarbage, kNothing };
  static constexpr const char* kUrl = "udpm://239.255.76.67:7667?ttl=0";

  RecoveryRig(const std::filesystem::path& programs, DriverUnderTest driver, const std::string& config);
  ~RecoveryRig();
  RecoveryRig(const RecoveryRig&) = delete;
  RecoveryRig& operator=(const RecoveryRig&) = delete;

  /// The device speaks, the bus is read, until `done` or for `patience_s`. False where it never came true.
  bool run_until(Says says, double patience_s, const std::function<bool()>& done);
  void run_for(Says says, double seconds) {
    run_until(says, seconds, [] { return false; });
  }
  /// Frames until a sensor message comes after the trouble; s since the driver was killed, the device plugged in, or
  /// now.
  double recovery_s();
  void kill_driver();
  void unplug_for(double seconds);

  /// Everything that came on a channel, in order.
  [[nodiscard]] const std::vector<Bytes>& on(const std::string& channel) { return received_[channel]; }
  [[nodiscard]] std::vector<raw_t> raw() const;
  [[nodiscard]] heartbeat_t heartbeat() const;
  [[nodiscard]] const MadeDevice& device() const { return device_; }
  [[nodiscard]] const std::vector<ExpectedGap>& gaps() const { return gaps_; }
  /// What `roadfix run` and the driver said.
  [[nodiscard]] std::string said() const;
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }

 private:
  void speak(Says says);
  [[nodiscard]] pid_t driver_pid() const;

  TemporaryFolder folder_;
  DriverUnderTest driver_;
  MadeDevice device_;
  NetworkBus bus_;
  pid_t supervisor_ = 0;
  std::map<std::string, std::vector<Bytes>> received_;
  std::mt19937 random_{5};
  SteadyTime begin_ = std::chrono::steady_clock::now();
  double next_s_ = 0.0;
  std::optional<SteadyTime> trouble_;
  std::vector<ExpectedGap> gaps_;
};

}  // namespace roadfix::test
