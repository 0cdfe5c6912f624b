/// LCM over UDP, without its silences: what waits is bounded and counted, the receive buffer is checked, the kernel's
/// drops at our socket are read, and handlers run outside LCM's C code. One thread uses a bus. lcm_facts.md, section 0,
/// holds the measurements behind this.
///
/// LCM itself only publishes. It receives in a thread of its own, which wakes the one that handles: two wake-ups for
/// each message, tens of microseconds each where the processor had gone to sleep. Here the thread that waits for a
/// message reads the socket itself; while it does something else for long, a keeper empties the socket into the queue.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <regex>
#include <thread>

#include "bus/bus.h"
#include "bus/transport/bus_url.h"

namespace lcm {
class LCM;
}

namespace roadfix {

class Datagrams;
class GroupSocket;

inline constexpr const char* kDefaultBusUrl = "udpm://239.255.76.67:7667?ttl=0";

/// What is asked of the kernel where the URL does not say: enough for raw images of a megabyte.
constexpr int kReceiveBufferBytes = 4 << 20;

class NetworkBus : public Bus {
 public:
  /// Throws BusError; its text names the URL and `roadfix doctor`.
  explicit NetworkBus(const std::string& url = kDefaultBusUrl);
  ~NetworkBus() override;
  NetworkBus(const NetworkBus&) = delete;
  NetworkBus& operator=(const NetworkBus&) = delete;

  void subscribe(const std::string& channels, Handler handler, const QueuePolicy& policy = {}) override;
  void publish(const std::string& channel, std::span<const uint8_t> bytes) override;
  bool handle(std::chrono::milliseconds patience) override;
  [[nodiscard]] std::vector<QueueStatus> queues() const override;
  [[nodiscard]] int64_t unsent() const override { return unsent_; }
  [[nodiscard]] int64_t kernel_drops() const override;

  /// What the kernel gave our socket, in the bytes that were asked for; 0 before the first subscribe(). Smaller than
  /// kReceiveBufferBytes: raw images will be lost (net.core.rmem_max is too small).
  [[nodiscard]] int receive_buffer_bytes() const;

 private:
  struct Subscription {
    std::regex channels;
    Handler handler;
    QueuePolicy policy;
    QueueStatus status;
    std::size_t waiting_bytes = 0;
  };
  struct Waiting {
    Subscription* subscription = nullptr;
    std::string channel;
    int64_t received_us = 0;
    std::vector<uint8_t> bytes;
  };
  using Route = std::vector<Subscription*>;

  void begin_to_receive();
  void wait(std::chrono::milliseconds patience);
  bool attend();
  void drain();
  void drain_locked();
  void keep_drained(const std::stop_token& stop);
  const Route& route(std::string_view channel);
  void put(Subscription& subscription, std::string_view channel, int64_t received_us, std::span<const uint8_t> bytes);
  std::optional<Waiting> next();

  BusUrl url_;
  std::unique_ptr<lcm::LCM> lcm_;
  int64_t unsent_ = 0;

  mutable std::mutex mutex_;  ///< of all below up to the keeper; never held while a handler runs
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::map<std::string, Route, std::less<>> routes_;
  std::unique_ptr<GroupSocket> socket_;
  std::unique_ptr<Datagrams> datagrams_;
  std::deque<Waiting> queue_;
  std::vector<std::vector<uint8_t>> free_;

  bool attended_ = false;  ///< the thread of handle() waits at the socket

  std::condition_variable_any keeper_waits_;
  std::jthread keeper_;
};

}  // namespace roadfix
