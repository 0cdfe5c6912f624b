/// A stage for tests of the bus: its state depends on the bits and the order of everything that it is given.
#pragma once

#include <deque>
#include <roadfix/gnss_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/stage.h"
#include "stream/state_bytes.h"

namespace roadfix::test {

/// state <- factor * state + value, which neither commutes nor associates. The output is the state carried on over the
/// clock samples ahead of it.
class ChainStage : public Stage {
 public:
  explicit ChainStage(StageSpec spec, double factor = 0.99) : spec_(std::move(spec)), factor_(factor) {}

  const StageSpec& spec() const override { return spec_; }

  void apply(const Message& message) override {
    state_ = step(state_, value_of(message));
    state_utime_ = std::max(state_utime_, message.utime);
    while (!ahead_.empty() && ahead_.front().first <= state_utime_) ahead_.pop_front();
  }

  void on_clock(const Message& message) override { ahead_.emplace_back(message.utime, value_of(message)); }

  void publish(int64_t, Outputs& outputs) override {
    double now = state_;
    for (const auto& [utime, value] : ahead_) now = step(now, value);
    pose_t pose{};
    pose.position_m[0] = now;
    pose.position_m[1] = static_cast<double>(++published_);
    outputs.publish(0, pose);
  }

  void digest(Digest& digest) const override { digest.add(state_); }

  std::vector<uint8_t> save() const override {
    StateWriter writer;
    writer.put(state_);
    writer.put(state_utime_);
    writer.put(published_);
    return writer.take();
  }

  void load(std::span<const uint8_t> state) override {
    StateReader reader(state);
    reader.get(state_);
    reader.get(state_utime_);
    reader.get(published_);
    reader.finish();
    ahead_.clear();
  }

  std::string effective_config() const override { return "factor: " + std::to_string(factor_).substr(0, 4) + "\n"; }

 private:
  double step(double state, double value) const { return factor_ * state + value; }

  double value_of(const Message& message) const {
    const std::string& type = spec_.inputs[static_cast<std::size_t>(message.input)].type;
    if (type == "imu_t") return decode<imu_t>(message.bytes).gyro_radps[0];
    if (type == "gnss_t") return decode<gnss_t>(message.bytes).height_m;
    if (type == "wheels_t") return decode<wheels_t>(message.bytes).speed_mps[0];
    return decode<pose_t>(message.bytes).position_m[0];
  }

  StageSpec spec_;
  double factor_;
  double state_ = 0.0;
  int64_t state_utime_ = 0;
  int64_t published_ = 0;
  std::deque<std::pair<int64_t, double>> ahead_;
};

/// IMU as its clock, GNSS and WHEELS late by up to 250 and 50 ms.
inline StageSpec filter_spec() {
  return {"filter",
          {{"IMU", "imu_t"}, {"GNSS", "gnss_t", 250'000}, {"WHEELS", "wheels_t", 50'000}},
          {{0, 100'000}},
          {{"POSE_INS", "pose_t"}}};
}

/// IMU as its clock and WHEELS, without waiting.
inline StageSpec odometry_spec() {
  return {"odometry", {{"WHEELS", "wheels_t"}, {"IMU", "imu_t"}}, {{1, 100'000}}, {{"POSE_WHEEL", "pose_t"}}};
}

/// POSE_INS as its clock, then POSE_WHEEL.
inline StageSpec fusion_spec() {
  return {"fusion",
          {{"POSE_INS", "pose_t"}, {"POSE_WHEEL", "pose_t", 50'000}},
          {{0, 200'000}, {1, 200'000}},
          {{"POSE_FUSED", "pose_t"}}};
}

}  // namespace roadfix::test
