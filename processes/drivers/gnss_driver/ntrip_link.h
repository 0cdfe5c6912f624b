/// The connection to an NTRIP caster, on a thread of its own: neither its name nor its silence holds up the receiver.
#pragma once

#include <atomic>
#include <mutex>
#include <thread>

#include "drivers/device/driver.h"
#include "drivers/gnss_driver/handler.h"

namespace roadfix {

class NtripLink : public Companion {
 public:
  /// Throws std::runtime_error where the password's file cannot be read.
  explicit NtripLink(const NtripConfig& config);
  ~NtripLink() override;
  NtripLink(const NtripLink&) = delete;
  NtripLink& operator=(const NtripLink&) = delete;

  void step(int64_t now_utime, const SensorDriver& driver, ByteSource* device) override;
  [[nodiscard]] std::string state_reason() const override;
  [[nodiscard]] std::vector<uint8_t> take_received() override;
  [[nodiscard]] std::string raw_channel() const override { return "RAW_NTRIP"; }

 private:
  void work();
  void run_session();
  void set_state_reason(const std::string& text);

  NtripConfig config_;
  std::string request_;
  mutable std::mutex mutex_;
  std::string state_reason_ = "NTRIP: not connected yet";
  std::vector<uint8_t> corrections_;  ///< received, not yet for the device
  std::vector<uint8_t> received_;     ///< the same, not yet taken
  std::string position_;              ///< the newest, for the caster
  bool device_rejects_ = false;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace roadfix
