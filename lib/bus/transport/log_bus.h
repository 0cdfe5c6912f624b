/// A recorded drive as a bus: its events in the order of the file, one per handle(); what is published goes to another
/// log, stamped with message time. Deterministic, and as the messages arrived: what came late is late again.
#pragma once

#include <regex>

#include "bus/bus.h"
#include "bus/log/log_reader.h"
#include "bus/log/log_writer.h"

namespace roadfix {

class LogBus : public Bus {
 public:
  /// `out` may be null: then publishing is an error.
  explicit LogBus(const std::filesystem::path& in, LogWriter* out = nullptr) : reader_(in), out_(out) {}

  void subscribe(const std::string& channels, Handler handler, const QueuePolicy& policy = {}) override;
  void publish(const std::string& channel, std::span<const uint8_t> bytes) override;
  bool handle(std::chrono::milliseconds timeout) override;

  [[nodiscard]] const LogReader& reader() const { return reader_; }

 private:
  struct Subscription {
    std::regex channels;
    Handler handler;
    std::map<std::string, bool, std::less<>> matches;  // channels seen so far
  };

  LogReader reader_;
  LogWriter* out_;
  std::vector<Subscription> subscriptions_;
};

}  // namespace roadfix
