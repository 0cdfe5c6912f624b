/// A live stage on a bus in memory with a logger beside it, and what verify says of its recording.
#pragma once

#include <catch2/catch.hpp>

#include "bus/run/live_stage.h"
#include "bus/transport/memory_bus.h"
#include "bus/verify/verify.h"
#include "support/recorded_car.h"
#include "support/temporary_folder.h"

namespace roadfix::test {

/// One live stage on a bus, with a logger beside it.
class Recorder {
 public:
  explicit Recorder(NewStage make, const std::filesystem::path& memory = {}) : make_(std::move(make)) {
    bus_.subscribe(".*", [this](const BusMessage& message) {
      const Header header = *read_header(message.bytes);
      log_.push_back({std::string(message.channel), header, {message.bytes.begin(), message.bytes.end()}});
    });
    live_ = std::make_unique<LiveStage>(make_, bus_);
    if (!memory.empty()) live_->keep_memory_in(memory);
  }

  void play(const DriveMessage& message) { bus_.publish(message.channel, message.bytes); }
  void step() { live_->step(std::chrono::milliseconds(0)); }
  void play_all(const std::vector<DriveMessage>& drive) {
    for (const DriveMessage& message : drive) {
      play(message);
      step();
    }
  }
  void stop() {
    live_->stop();
    bus_.handle(std::chrono::milliseconds(0));
  }

  const LiveStage& live() const { return *live_; }
  const std::vector<LoggedEvent>& log() const { return log_; }

  StageVerdict verdict() const {
    const TemporaryFolder folder;
    write_events(folder / "drive.lcm", log_);
    return verify({folder / "drive.lcm"}, {make_}).stages.at(0);
  }

  heartbeat_t last_heartbeat() const {
    const auto last = std::find_if(log_.rbegin(), log_.rend(),
                                   [](const LoggedEvent& event) { return event.channel.starts_with("HEARTBEAT_"); });
    return decode<heartbeat_t>(last->bytes);
  }

 private:
  NewStage make_;
  MemoryBus bus_;
  std::vector<LoggedEvent> log_;
  std::unique_ptr<LiveStage> live_;
};

template <class StageType = ChainStage>
NewStage maker(const StageSpec& spec) {
  return [spec] { return std::make_unique<StageType>(spec); };
}

inline void require_all_identical(const StageVerdict& verdict, int64_t at_least) {
  for (const RunVerdict& run : verdict.runs) {
    if (run.first_difference) UNSCOPED_INFO(*run.first_difference);
    for (const std::string& finding : run.findings) UNSCOPED_INFO(finding);
    for (const std::string& loss : run.losses) UNSCOPED_INFO(loss);
  }
  CHECK(verdict.differing() == 0);
  CHECK(verdict.unverifiable() == 0);
  CHECK(verdict.identical() >= at_least);
}

/// The same drive, with other stamps or by other starts of the drivers.
inline std::vector<DriveMessage> shifted(std::vector<DriveMessage> drive, int64_t utime_us, int64_t run_us) {
  for (DriveMessage& message : drive) {
    message.header.utime += utime_us;
    message.header.run += run_us;
    // Behind the fingerprint: utime, run.
    const auto put = [&](std::size_t at, int64_t value) {
      for (std::size_t i = 0; i < 8; ++i) message.bytes[at + i] = static_cast<uint8_t>(value >> (56 - 8 * i));
    };
    put(8, message.header.utime);
    put(16, message.header.run);
  }
  return drive;
}

}  // namespace roadfix::test
