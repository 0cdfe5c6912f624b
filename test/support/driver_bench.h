/// A driver on a bus of memory, a serial device to plug into it, and a replay of what it published.
#pragma once

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <string>
#include <vector>

#include "bus/log/log_reader.h"
#include "bus/log/log_writer.h"
#include "bus/transport/memory_bus.h"
#include "drivers/device/live_driver.h"
#include "drivers/device/run_driver.h"
#include "support/driver_run.h"
#include "support/temporary_folder.h"

namespace roadfix::test {

/// A made serial device: what is written here arrives there.
class Pty {
 public:
  Pty() : main_(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    REQUIRE(::grantpt(main_) == 0);
    REQUIRE(::unlockpt(main_) == 0);
    name_ = ::ptsname(main_);
  }
  ~Pty() { ::close(main_); }
  Pty(const Pty&) = delete;
  Pty& operator=(const Pty&) = delete;

  void write(const Bytes& bytes) const {
    REQUIRE(::write(main_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
  }
  [[nodiscard]] Bytes read() const {
    Bytes bytes(65536);
    const ssize_t size = ::read(main_, bytes.data(), bytes.size());
    bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
    return bytes;
  }
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  int main_;
  std::string name_;
};

/// A driver on a bus of memory, with everything that it published.
class Bench {
 public:
  explicit Bench(DriverSetup setup) : setup_(std::move(setup)), driver_(setup_, bus_) {
    bus_.subscribe(".*", [this](const BusMessage& m) {
      sent.push_back({std::string(m.channel), {m.bytes.begin(), m.bytes.end()}});
    });
  }
  template <class Done>
  bool step_until(const Done& done) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!done()) {
      if (std::chrono::steady_clock::now() > end) return false;
      more = driver_.step(std::chrono::milliseconds(5));
      bus_.handle(std::chrono::milliseconds(0));
    }
    return true;
  }
  [[nodiscard]] std::size_t count(const std::string& channel) const {
    return static_cast<std::size_t>(
        std::count_if(sent.begin(), sent.end(), [&](const Published& s) { return s.channel == channel; }));
  }
  [[nodiscard]] heartbeat_t heartbeat() const {
    for (auto s = sent.rbegin(); s != sent.rend(); ++s)
      if (s->channel.starts_with("HEARTBEAT_")) return decode<heartbeat_t>(s->bytes);
    return {};
  }
  LiveDriver& driver() { return driver_; }
  const DriverSetup& setup() { return setup_; }

  std::vector<Published> sent;
  bool more = true;

 private:
  DriverSetup setup_;
  MemoryBus bus_;
  LiveDriver driver_;
};

/// What a replay of the bench's raw messages gives.
inline std::vector<Published> replayed(Bench& bench) {
  const test::TemporaryFolder folder;
  {
    LogWriter log(folder / "raw.lcm");
    for (const Published& s : bench.sent)
      if (s.channel.starts_with("RAW_")) log.write(s.channel, read_header(s.bytes)->utime, s.bytes);
    log.commit();
  }
  replay_driver(folder / "raw.lcm", folder / "out.lcm", bench.setup());
  LogReader reader(folder / "out.lcm");
  std::vector<Published> out;
  while (const auto event = reader.next())
    out.push_back({std::string(event->channel), {event->data.begin(), event->data.end()}});
  return out;
}

inline std::vector<Published> sensor_messages(const Bench& bench) {
  std::vector<Published> out;
  for (const Published& s : bench.sent)
    if (!s.channel.starts_with("RAW_") && !s.channel.starts_with("HEARTBEAT_") && !s.channel.starts_with("CONFIG_"))
      out.push_back(s);
  return out;
}

}  // namespace roadfix::test
