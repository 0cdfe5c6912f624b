/// A drive as it happens in a car, without a network: messages arrive with delays, stages publish, a logger writes; and
/// whatever goes wrong on the way.
#pragma once

#include <functional>
#include <memory>
#include <random>

#include "bus/log/log_reader.h"
#include "bus/run/stage_runner.h"
#include "support/chain_stage.h"
#include "support/small_drive.h"

namespace roadfix::test {

/// True where a message does not get there.
using Drops = std::function<bool(const std::string& to, const std::string& channel, const Header& header)>;

struct CarTroubles {
  unsigned seed = 1;
  int64_t delay_us = 40'000;  ///< of every channel but IMU, at most
  Drops drops = [](const std::string&, const std::string&, const Header&) { return false; };  ///< "log" is the logger
  std::string killed_stage;                                                                   ///< restarted 2 s later
  int64_t killed_at_us = 0;  ///< after the drive's start
  int64_t log_from_us = 0;   ///< the recording begins so long after the drive
};

struct LoggedEvent {
  std::string channel;
  Header header;
  std::vector<uint8_t> bytes;
};

class RecordedCar : public MessageSink {
 public:
  RecordedCar(std::vector<StageSpec> specs, CarTroubles troubles) : troubles_(std::move(troubles)) {
    for (StageSpec& spec : specs) stages_.push_back({std::move(spec), nullptr});
  }

  /// What the logger wrote, in the order in which it came.
  std::vector<LoggedEvent> drive(const std::vector<DriveMessage>& messages) {
    for (Slot& slot : stages_) start(slot, kDriveStart_us);
    std::vector<std::pair<int64_t, const DriveMessage*>> arrivals;
    std::mt19937 random(troubles_.seed);
    for (const DriveMessage& message : messages) {
      const int64_t delay = message.channel == "IMU" ? 0 : static_cast<int64_t>(random()) % troubles_.delay_us;
      arrivals.emplace_back(message.header.utime + delay, &message);
    }
    std::stable_sort(arrivals.begin(), arrivals.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [arrives, message] : arrivals) {
      now_ = arrives;
      tend(arrives - kDriveStart_us);
      deliver(message->channel, message->header, message->bytes);
    }
    return std::move(log_);
  }

 private:
  struct Slot {
    StageSpec spec;
    std::unique_ptr<StageRunner> runner;
    bool restarted = false;
  };

  void start(Slot& slot, int64_t utime) {
    slot.runner = std::make_unique<StageRunner>(std::make_unique<ChainStage>(slot.spec), *this);
    config_t config = slot.runner->config_message();
    config.utime = utime;
    config.run = utime;
    log(stage_channel("CONFIG_", slot.spec.name), {utime, utime, 0}, encode(config));
  }

  void tend(int64_t elapsed_us) {
    for (Slot& slot : stages_) {
      if (slot.spec.name != troubles_.killed_stage || elapsed_us < troubles_.killed_at_us) continue;
      if (elapsed_us < troubles_.killed_at_us + 2'000'000) {
        slot.runner.reset();
      } else if (!slot.restarted) {
        slot.restarted = true;
        start(slot, kDriveStart_us + elapsed_us);
      }
    }
  }

  void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) override {
    deliver(channel, header, bytes);
  }

  void deliver(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) {
    log(channel, header, bytes);
    for (Slot& slot : stages_) {
      for (int i = 0; i < static_cast<int>(slot.spec.inputs.size()); ++i) {
        if (slot.spec.inputs[static_cast<std::size_t>(i)].channel != channel || !slot.runner) continue;
        if (!troubles_.drops(slot.spec.name, channel, header)) slot.runner->offer(i, bytes);
      }
    }
  }

  void log(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) {
    if (now_ < kDriveStart_us + troubles_.log_from_us && !channel.starts_with("CONFIG_")) return;
    if (!troubles_.drops("log", channel, header)) log_.push_back({channel, header, {bytes.begin(), bytes.end()}});
  }

  CarTroubles troubles_;
  std::vector<Slot> stages_;
  std::vector<LoggedEvent> log_;
  int64_t now_ = kDriveStart_us;
};

inline void write_events(const std::filesystem::path& path, std::span<const LoggedEvent> events) {
  LogWriter writer(path);
  for (const LoggedEvent& event : events) writer.write(event.channel, event.header.utime, event.bytes);
  writer.commit();
}

}  // namespace roadfix::test
