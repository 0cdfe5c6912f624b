/// How processes exchange messages. One interface, several implementations: the network (LCM over
/// UDP), memory (tests), a log (a recorded drive in the order of its arrival). A handler cannot distinguish them.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace roadfix {

/// A bus that cannot be opened or used; the text names the remedy.
struct BusError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct BusMessage {
  std::string_view channel;
  std::span<const uint8_t> bytes;  ///< as they came: unchecked; valid during the call
  int64_t received_us = 0;         ///< wall clock; of a log: the event's stamp
};

/// What waits between the bus and its handler. Nothing is dropped without being counted.
struct QueuePolicy {
  std::size_t max_bytes = std::size_t{64} << 20;  ///< of one subscription; what does not fit is dropped
};

struct QueueStatus {
  int64_t received = 0;
  int64_t dropped = 0;  ///< did not fit into the queue
  int32_t depth = 0;
  int64_t oldest_us = 0;  ///< receive time of the oldest that waits; 0 when none does
};

class Bus {
 public:
  using Handler = std::function<void(const BusMessage&)>;
  virtual ~Bus() = default;

  /// `channels`: a regular expression over the whole name, as LCM takes it.
  virtual void subscribe(const std::string& channels, Handler handler, const QueuePolicy& policy = {}) = 0;

  /// What the network does not take now (a cable pulled, a route gone) is counted in unsent(): the process goes on.
  /// Throws BusError where the message could never be sent.
  virtual void publish(const std::string& channel, std::span<const uint8_t> bytes) = 0;

  /// Waits up to `timeout` for a message, then hands out all that are there, in the order of their arrival.
  /// False when no message will ever come again. What a handler throws comes through.
  virtual bool handle(std::chrono::milliseconds timeout) = 0;

  /// Per subscription, in the order of subscribe().
  [[nodiscard]] virtual std::vector<QueueStatus> queues() const { return {}; }

  /// Messages of publish() that the network did not take.
  [[nodiscard]] virtual int64_t unsent() const { return 0; }

  /// Datagrams that the kernel dropped at our socket since it was opened.
  [[nodiscard]] virtual int64_t kernel_drops() const { return 0; }
};

}  // namespace roadfix
