/// A driver fed with made bytes, and what comes out of it.
#pragma once

#include <string>
#include <vector>

#include "drivers/device/driver.h"
#include "support/device_bytes.h"

namespace roadfix::test {

struct Published {
  std::string channel;
  Bytes bytes;
  bool operator==(const Published&) const = default;
};

class CollectedSensors : public SensorOutputs {
 public:
  std::vector<Published> sent;

  template <class T>
  [[nodiscard]] std::vector<T> on(const std::string& channel) const {
    std::vector<T> messages;
    for (const Published& message : sent)
      if (message.channel == channel) messages.push_back(decode<T>(message.bytes));
    return messages;
  }

 protected:
  void send(const std::string& channel, int64_t, std::span<const uint8_t> bytes) override {
    sent.push_back({channel, {bytes.begin(), bytes.end()}});
  }
};

struct RawRead {
  int64_t utime = 0;
  Bytes bytes;
};

/// All messages of a driver's life.
inline CollectedSensors run_driver_over(SensorDriver& driver, const std::vector<RawRead>& reads) {
  CollectedSensors outputs;
  outputs.begin(1);
  driver.opened(0);
  for (const RawRead& read : reads) driver.take(0, read.utime, read.bytes, outputs);
  return outputs;
}

}  // namespace roadfix::test
