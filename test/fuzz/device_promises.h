/// What a driver promises of each message, whatever its device sent: the program ends where one is broken.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "drivers/device/driver.h"

namespace roadfix::test {

/// Aborts with `what` where it does not hold.
void promise(bool holds, const char* what);

/// Takes the drivers' messages, tests each, and keeps them by channel.
class PromisedOutputs : public SensorOutputs {
 public:
  /// The time of the newest read; no message is later than that plus `ahead_us`.
  void read_at(int64_t utime, int64_t ahead_us) { latest_utime_ = utime + ahead_us; }
  [[nodiscard]] const std::map<std::string, std::vector<std::vector<uint8_t>>>& sent() const { return sent_; }

 protected:
  void send(const std::string& channel, int64_t utime, std::span<const uint8_t> bytes) override;

 private:
  int64_t latest_utime_ = 0;
  std::map<std::string, std::vector<std::vector<uint8_t>>> sent_;
};

}  // namespace roadfix::test
