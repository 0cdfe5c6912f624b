/// Wheel speeds from a CAN bus: the frames of RAW_WHEELS (lines of candump) to wheels_t, by a mapping in YAML with the
/// numbers of the vehicle's DBC file.
#pragma once

#include <filesystem>

#include "drivers/device/driver.h"
#include "drivers/protocols/can_signal.h"
#include "drivers/protocols/candump.h"
#include "drivers/protocols/device_clock.h"
#include "drivers/protocols/framer.h"
#include "samples/samples.h"
#include "wheel/wheel_encoder.h"

namespace roadfix {

/// Where the signals are counters of encoders in place of speeds. A counter's range is that of its signal's bits.
struct WheelTicks {
  double ticks_per_turn = 0.0;
  double wheel_radius = 0.0;  ///< m, rolling
};

template <class Visitor>
void visit(WheelTicks& c, Visitor& v) {
  v.require("ticks_per_turn");
  v.number("ticks_per_turn", c.ticks_per_turn, 1e-3, 1e7);
  v.require("wheel_radius_m");
  v.number("wheel_radius_m", c.wheel_radius, 0.01, 5.0);
}

struct WheelDriverConfig {
  DeviceConfig device;
  std::string channel = "WHEELS";
  /// One: of the rear axle's centre. Four: front left, front right, rear left, rear right. m/s.
  std::vector<CanSignal> speeds;
  bool speeds_signed = false;          ///< negative when reversing
  std::optional<WheelTicks> ticks;     ///< `speeds` are counters
  std::optional<CanSignal> direction;  ///< for example the gear lever
  std::vector<int64_t> forward;        ///< raw values of `direction`
  std::vector<int64_t> reverse;
  std::optional<CanSignal> yaw_rate;  ///< rad/s, positive to the left
  double max_age = 0.1;               ///< s; signals of one message are no further apart
  double max_speed = 120.0;           ///< m/s; a faster wheel is an error
  double max_yaw_rate = 10.0;         ///< rad/s; a faster turn is an error, and no yaw rate
};

/// What counters must be: of one range, and untouched by a factor.
bool same_length(const std::vector<CanSignal>& counters);

template <class Visitor>
void visit(WheelDriverConfig& c, Visitor& v) {
  visit(c.device, v);
  v.text("channel", c.channel);
  v.require("speeds");
  v.groups("speeds", c.speeds);
  v.check("speeds", c.speeds.size() == 1 || c.speeds.size() == 4, "must be one signal, or four");
  v.boolean("speeds_signed", c.speeds_signed);
  v.optional_group("ticks", c.ticks);
  v.check("ticks", !c.ticks || same_length(c.speeds), "counters must all be of one length, without factor and offset");
  v.optional_group("direction", c.direction);
  v.integers("forward", c.forward, INT64_MIN, INT64_MAX);
  v.integers("reverse", c.reverse, INT64_MIN, INT64_MAX);
  v.optional_group("yaw_rate", c.yaw_rate);
  v.number("max_age_s", c.max_age, 1e-3, 10.0);
  v.number("max_speed_mps", c.max_speed, 1.0, 1000.0);
  v.number("max_yaw_rate_radps", c.max_yaw_rate, 0.1, 1000.0);
}

class WheelDriver : public SensorDriver {
 public:
  /// Throws std::invalid_argument where a frame's identifier is none.
  explicit WheelDriver(const WheelDriverConfig& config);

  void opened(int stream) override;
  void take(int stream, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) override;
  [[nodiscard]] std::vector<StreamCounters> counters() const override;

 private:
  struct Tracked {
    CanSignal signal;
    CanId id;
    bool fresh = false;           ///< not yet in a message
    int64_t utime = 0;            ///< of the frame it came with
    std::optional<double> value;  ///< absent: not available
    std::optional<int64_t> raw;
  };

  static Tracked tracked(const CanSignal& signal);
  /// True where the frame has it.
  static bool update(Tracked& signal, const CanFrame& frame, int64_t utime);
  void take_frame(const CanFrame& frame, int64_t read_utime, SensorOutputs& outputs);
  void publish(int64_t utime, SensorOutputs& outputs);
  /// The wheels' newest values as speeds of `sample`; false where one is not available, or the first of its counter.
  bool take_speeds(WheelSample& sample);
  bool count_speeds(WheelSample& sample);
  [[nodiscard]] bool is_recent(const Tracked& signal, int64_t utime) const;

  WheelDriverConfig config_;
  Framer framer_;
  DeviceClock clock_;
  std::vector<Tracked> speeds_;
  std::optional<Tracked> direction_, yaw_rate_;
  std::optional<WheelEncoder> encoder_;
  int64_t frames_ = 0, used_ = 0, malformed_ = 0, unavailable_ = 0;
  int64_t published_ = 0, late_ = 0, newest_utime_ = 0;
};

/// VEHICLE/wheel_driver.yaml; `device` replaces its device where it is not empty.
DriverSetup wheel_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device);
DriverSetup wheel_driver_setup(const WheelDriverConfig& config);

}  // namespace roadfix
