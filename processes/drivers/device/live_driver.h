/// A driver on the bus: device to raw bytes to messages, with heartbeat, configuration and counts.
#pragma once

#include "bus/bus.h"
#include "bus/run/process_facts.h"
#include "bus/run/run_clock.h"
#include "bus/run/unsent_monitor.h"
#include "drivers/device/device_session.h"
#include "drivers/device/driver.h"

namespace roadfix {

class LiveDriver {
 public:
  /// `setup` outlives it.
  LiveDriver(const DriverSetup& setup, Bus& bus);

  /// Reads for up to `timeout` and publishes what came. False where nothing will ever come again (a file is over).
  bool step(std::chrono::milliseconds timeout);

  /// A last heartbeat.
  void stop();

  /// What is wrong with the device, as text; empty where nothing is.
  [[nodiscard]] std::string state_reason();
  [[nodiscard]] std::string device_name() const { return session_.name(); }
  /// How often the device was opened.
  [[nodiscard]] int64_t openings() const { return session_.openings(); }

 private:
  class BusOutputs : public SensorOutputs {
   public:
    explicit BusOutputs(Bus& bus) : bus_(bus) {}

   protected:
    void send(const std::string& channel, int64_t, std::span<const uint8_t> bytes) override {
      bus_.publish(channel, bytes);
    }

   private:
    Bus& bus_;
  };

  void take(int stream, int64_t utime, std::span<const uint8_t> bytes);
  void publish_raw(const std::string& channel, int64_t& seq, int64_t utime, std::span<const uint8_t> bytes);
  void publish_due();
  void publish_heartbeat(int64_t now_utime, bool stopping);
  void publish_config(int64_t now_utime);

  const DriverSetup& setup_;
  Bus& bus_;
  RunClock clock_;
  ProcessLoad load_;
  UnsentMonitor unsent_;
  BusOutputs outputs_;
  RawReader reader_;
  DeviceSession session_;
  std::unique_ptr<Companion> companion_;
  std::vector<Packet> packets_;
  std::vector<int64_t> raw_seq_;
  int64_t companion_seq_ = 0, heartbeat_seq_ = 0, config_seq_ = 0;
  int64_t next_heartbeat_us_ = 0, next_config_us_ = 0;
};

}  // namespace roadfix
