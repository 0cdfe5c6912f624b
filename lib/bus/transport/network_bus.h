/// LCM over UDP, without silent losses: LCM's own queue of 30 is lifted, what waits here is bounded and counted, the
/// receive buffer is checked, the kernel's drops at our socket are read, and handlers run outside LCM's C code.
/// One thread uses a bus. lcm_facts.md, section 0, holds the measurements behind this.
#pragma once

#include <deque>
#include <memory>

#include "bus/bus.h"

namespace lcm {
class LCM;
}

namespace roadfix {

inline constexpr const char* kDefaultBusUrl = "udpm://239.255.76.67:7667?ttl=0";

/// What is asked of the kernel where the URL does not set it: enough for raw images of a megabyte.
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
  bool handle(std::chrono::milliseconds timeout) override;
  [[nodiscard]] std::vector<QueueStatus> queues() const override;
  [[nodiscard]] int64_t unsent() const override { return unsent_; }
  [[nodiscard]] int64_t kernel_drops() const override;

  /// What the kernel gave our socket, in the bytes that were asked for; 0 before the first subscribe() and where the
  /// bus is no UDP. Smaller than kReceiveBufferBytes: raw images will be lost (net.core.rmem_max is too small).
  [[nodiscard]] int receive_buffer_bytes() const;

 private:
  struct Subscription;
  struct Waiting {
    Subscription* subscription = nullptr;
    std::string channel;
    int64_t received_us = 0;
    std::vector<uint8_t> bytes;
  };

  void receive(Subscription& subscription, const std::string& channel, int64_t received_us,
               std::span<const uint8_t> bytes) noexcept;
  void drain();

  std::unique_ptr<lcm::LCM> lcm_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::deque<Waiting> queue_;
  std::vector<std::vector<uint8_t>> free_;
  int port_ = 0;
  int64_t unsent_ = 0;
};

}  // namespace roadfix
