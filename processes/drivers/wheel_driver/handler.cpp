#include "drivers/wheel_driver/handler.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "bus/sample_codec.h"
#include "config/config.h"

namespace roadfix {

namespace {
bool contains(const std::vector<int64_t>& values, int64_t value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

/// 0: the counter is of 64 bits.
uint64_t range_of(const CanSignal& counter) { return counter.length < 64 ? uint64_t{1} << counter.length : 0; }
}  // namespace

bool same_length(const std::vector<CanSignal>& counters) {
  return std::all_of(counters.begin(), counters.end(), [&](const CanSignal& signal) {
    return signal.length == counters.front().length && signal.factor == 1.0 && signal.offset == 0.0;
  });
}

WheelDriver::WheelDriver(const WheelDriverConfig& config) : config_(config), framer_({probe_can_line}) {
  for (const CanSignal& speed : config.speeds) speeds_.push_back(tracked(speed));
  if (config.direction) direction_ = tracked(*config.direction);
  if (config.yaw_rate) yaw_rate_ = tracked(*config.yaw_rate);
  if (config.ticks) {
    encoder_.emplace(
        EncoderConfig{config.ticks->ticks_per_turn, config.ticks->wheel_radius, range_of(config.speeds.front())});
  }
}

WheelDriver::Tracked WheelDriver::tracked(const CanSignal& signal) {
  const std::optional<CanId> id = parse_can_id(signal.frame);
  if (!id)
    throw std::invalid_argument("frame = '" + signal.frame + "': no CAN identifier in hex, for example \"0x1A0\"");
  Tracked result;
  result.signal = signal;
  result.id = *id;
  return result;
}

void WheelDriver::opened(int) {
  framer_.reset();
  clock_.restart();
  for (Tracked& speed : speeds_) speed.fresh = false;
  if (encoder_) encoder_->restart();
}

void WheelDriver::take(int, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) {
  framer_.feed(read_utime, bytes);
  while (const std::optional<Frame> line = framer_.next()) {
    CanFrame frame;
    if (parse_can_line(line->bytes, frame)) {
      if (!frame.remote && !frame.error) take_frame(frame, read_utime, outputs);
    } else {
      ++malformed_;
    }
  }
}

bool WheelDriver::update(Tracked& signal, const CanFrame& frame, int64_t utime) {
  if (!(signal.id == CanId{frame.id, frame.extended})) return false;
  const std::span<const uint8_t> data(frame.data.data(), frame.size);
  signal.raw = raw_value(signal.signal, data);
  signal.value = value_of(signal.signal, data);
  signal.utime = utime;
  signal.fresh = true;
  return true;
}

void WheelDriver::take_frame(const CanFrame& frame, int64_t read_utime, SensorOutputs& outputs) {
  ++frames_;
  const std::optional<int64_t> utime = clock_.utime(frame.t_us, read_utime);
  if (!utime) return;
  bool ours = direction_ && update(*direction_, frame, *utime);
  ours = (yaw_rate_ && update(*yaw_rate_, frame, *utime)) || ours;
  bool speed = false;
  for (Tracked& wheel : speeds_) speed = update(wheel, frame, *utime) || speed;
  if (ours || speed) ++used_;
  const bool whole = std::all_of(speeds_.begin(), speeds_.end(),
                                 [&](const Tracked& wheel) { return wheel.fresh && is_recent(wheel, *utime); });
  if (speed && whole) publish(*utime, outputs);
}

bool WheelDriver::is_recent(const Tracked& signal, int64_t utime) const {
  return static_cast<double>(utime - signal.utime) <= config_.max_age * 1e6;
}

bool WheelDriver::take_speeds(WheelSample& sample) {
  const bool available =
      std::all_of(speeds_.begin(), speeds_.end(), [](const Tracked& t) { return t.value.has_value(); });
  for (Tracked& speed : speeds_) speed.fresh = false;
  if (!available || (encoder_ && !count_speeds(sample))) return false;
  for (std::size_t i = 0; i < speeds_.size(); ++i) {
    if (!encoder_) sample.speeds[i] = *speeds_[i].value;
    if (!(std::abs(sample.speeds[i]) <= config_.max_speed)) return false;
    if (!config_.speeds_signed) sample.speeds[i] = std::abs(sample.speeds[i]);  // a magnitude, whatever the sign
  }
  return true;
}

bool WheelDriver::count_speeds(WheelSample& sample) {
  EncoderReading reading{sample.t_us, sample.num_speeds, {}};
  for (std::size_t i = 0; i < speeds_.size(); ++i) reading.ticks[i] = speeds_[i].raw.value_or(0);
  const std::optional<EncoderSpeeds> counted = encoder_->add(reading);
  if (!counted) return false;
  sample.t_us = counted->t_us;
  sample.speeds = counted->speed;
  return true;
}

void WheelDriver::publish(int64_t utime, SensorOutputs& outputs) {
  WheelSample sample;
  sample.t_us = utime;
  sample.num_speeds = static_cast<int>(speeds_.size());
  if (!take_speeds(sample)) {
    ++unavailable_;
    return;
  }
  sample.direction = config_.speeds_signed ? WheelDirection::kSigned : WheelDirection::kUnknown;
  if (direction_ && direction_->raw && !config_.speeds_signed) {
    if (contains(config_.forward, *direction_->raw)) sample.direction = WheelDirection::kForward;
    if (contains(config_.reverse, *direction_->raw)) sample.direction = WheelDirection::kReverse;
  }
  if (yaw_rate_ && yaw_rate_->utime != 0 && is_recent(*yaw_rate_, utime)) {
    const std::optional<double>& value = yaw_rate_->value;
    if (value && std::abs(*value) <= config_.max_yaw_rate) sample.yaw_rate = value;
  }
  wheels_t message = to_message(sample);
  if (outputs.publish(config_.channel, message)) {
    ++published_;
    newest_utime_ = sample.t_us;
  } else {
    ++late_;
  }
}

std::vector<StreamCounters> WheelDriver::counters() const {
  return {{config_.channel, published_ + late_ + unavailable_, published_, 0, unavailable_, late_, 0, newest_utime_},
          {"CAN", frames_ + malformed_, used_, 0, malformed_, 0, framer_.skipped_bytes(), 0}};
}

DriverSetup wheel_driver_setup(const WheelDriverConfig& config) {
  const WheelDriver checked(config);  // a wrong identifier is found at the start
  DriverSetup setup;
  setup.name = "wheel_driver";
  setup.raw_channels = {"RAW_WHEELS"};
  setup.config = explained_config_text(config);
  setup.device = config.device;
  setup.make = [config] { return std::make_unique<WheelDriver>(config); };
  setup.open = [config](const auto&) { return open_byte_source(config.device); };
  return setup;
}

DriverSetup wheel_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device) {
  auto config = load_config<WheelDriverConfig>(vehicle_dir / "wheel_driver.yaml");
  if (!device.empty()) config.device.device = device;
  return wheel_driver_setup(config);
}

}  // namespace roadfix
