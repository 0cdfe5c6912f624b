#include "wheel/wheel_encoder.h"

#include "samples/samples.h"
#include "wheel/wheel_kinematics.h"

namespace roadfix {

int64_t tick_difference(int64_t from, int64_t to, uint64_t wraps_at) {
  const auto difference = static_cast<int64_t>(static_cast<uint64_t>(to) - static_cast<uint64_t>(from));
  if (wraps_at == 0 || wraps_at > uint64_t{1} << 62U) return difference;
  const auto range = static_cast<int64_t>(wraps_at);
  int64_t shortest = difference % range;
  if (shortest > range / 2) shortest -= range;
  if (shortest < -(range / 2)) shortest += range;
  return shortest;
}

std::optional<EncoderSpeeds> WheelEncoder::add(const EncoderReading& reading) {
  const std::optional<EncoderReading> before = last_;
  if (before && reading.t_us <= before->t_us) return std::nullopt;
  last_ = reading;
  if (!before || before->num_wheels != reading.num_wheels) return std::nullopt;
  const double dt_s = seconds_between(before->t_us, reading.t_us);
  if (dt_s > config_.max_gap) return std::nullopt;
  EncoderSpeeds speeds;
  speeds.t_us = before->t_us + (reading.t_us - before->t_us) / 2;
  for (std::size_t i = 0; i < static_cast<std::size_t>(reading.num_wheels); ++i) {
    const int64_t ticks = tick_difference(before->ticks[i], reading.ticks[i], config_.wraps_at);
    speeds.speed[i] = rim_speed(ticks, config_.ticks_per_turn, config_.wheel_radius, dt_s);
  }
  return speeds;
}

}  // namespace roadfix
