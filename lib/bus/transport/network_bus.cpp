#include "bus/transport/network_bus.h"

#include <cerrno>
#include <lcm/lcm-cpp.hpp>
#include <new>

#include "bus/log/log_file.h"
#include "bus/transport/udp_socket.h"
#include "bus/types/message.h"

namespace roadfix {

namespace {

/// Messages drained before the first of them is handled; the rest stays in LCM's queue, which has no bound.
constexpr int kDrainAtOnce = 1000;
/// Messages and time handled before the caller gets its turn (heartbeats, the watchdog), however many wait.
constexpr int kHandleAtOnce = 1000;
constexpr auto kHandleFor = std::chrono::milliseconds(100);
constexpr std::size_t kMaxFreeBuffers = 64;
/// Of one that is kept: a buffer never shrinks, so in the end each would be as large as the largest message ever.
constexpr std::size_t kMaxFreeBytes = 1 << 10;

std::string with_receive_buffer(const std::string& url) {
  if (!url.starts_with("udpm://") || url.find("recv_buf_size=") != std::string::npos) return url;
  return url + (url.find('?') == std::string::npos ? "?" : "&") +
         "recv_buf_size=" + std::to_string(kReceiveBufferBytes);
}

/// The port of udpm://GROUP:PORT?...; LCM's own where the URL has none; 0 for another provider.
int port_of(const std::string& url) {
  if (!url.starts_with("udpm://")) return 0;
  const std::string address = url.substr(7, url.find('?') - 7);
  const std::size_t colon = address.find(':');
  return colon == std::string::npos ? 7667 : std::stoi(address.substr(colon + 1));
}

}  // namespace

struct NetworkBus::Subscription {
  NetworkBus* bus = nullptr;
  Handler handler;
  QueuePolicy policy;
  QueueStatus status;
  std::size_t waiting_bytes = 0;
};

NetworkBus::NetworkBus(const std::string& url) {
  try {
    port_ = port_of(url);
  } catch (const std::logic_error&) {
    throw BusError("bus URL '" + url + "': no such port");
  }
  lcm_ = std::make_unique<lcm::LCM>(with_receive_buffer(url));
  if (!lcm_->good()) {
    throw BusError("cannot open the bus " + url + ": `roadfix doctor` tells what it lacks (a multicast route, mostly)");
  }
}

NetworkBus::~NetworkBus() = default;

void NetworkBus::subscribe(const std::string& channels, Handler handler, const QueuePolicy& policy) {
  subscriptions_.push_back(std::make_unique<Subscription>());
  Subscription& subscription = *subscriptions_.back();
  subscription.bus = this;
  subscription.handler = std::move(handler);
  subscription.policy = policy;
  using Receive = void (*)(const lcm::ReceiveBuffer*, const std::string&, Subscription*);
  const Receive forward = [](const lcm::ReceiveBuffer* buffer, const std::string& channel, Subscription* to) {
    to->bus->receive(*to, channel, buffer->recv_utime, {static_cast<const uint8_t*>(buffer->data), buffer->data_size});
  };
  lcm::Subscription* theirs = lcm_->subscribeFunction(channels, forward, &subscription);
  if (theirs == nullptr) throw BusError("cannot subscribe to '" + channels + "'");
  theirs->setQueueCapacity(0);  // no bound: the bound is ours, and counts what it drops
}

void NetworkBus::publish(const std::string& channel, std::span<const uint8_t> bytes) {
  if (channel.empty() || channel.size() > kMaxChannelBytes) throw BusError("no channel name: '" + channel + "'");
  if (bytes.size() > kMaxMessageBytes) throw BusError(channel + ": " + std::to_string(bytes.size()) + " bytes");
  // Of a message in several datagrams LCM reports that it was sent even where the system refused them; errno does not.
  errno = 0;
  if (lcm_->publish(channel, bytes.data(), static_cast<unsigned>(bytes.size())) != 0 || errno != 0) ++unsent_;
}

/// Called from LCM's C code: lets nothing through but a count.
void NetworkBus::receive(Subscription& subscription, const std::string& channel, int64_t received_us,
                         std::span<const uint8_t> bytes) noexcept {
  ++subscription.status.received;
  if (subscription.waiting_bytes + bytes.size() > subscription.policy.max_bytes) {
    ++subscription.status.dropped;
    return;
  }
  try {
    std::vector<uint8_t> copy;
    if (!free_.empty()) {
      copy = std::move(free_.back());
      free_.pop_back();
    }
    copy.assign(bytes.begin(), bytes.end());
    queue_.push_back({&subscription, channel, received_us, std::move(copy)});
    subscription.waiting_bytes += bytes.size();
    ++subscription.status.depth;
  } catch (const std::bad_alloc&) {
    ++subscription.status.dropped;
  }
}

void NetworkBus::drain() {
  for (int i = 0; i < kDrainAtOnce && lcm_->handleTimeout(0) > 0; ++i) {
  }
}

bool NetworkBus::handle(std::chrono::milliseconds timeout) {
  if (queue_.empty()) lcm_->handleTimeout(static_cast<int>(timeout.count()));
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kHandleAtOnce && !queue_.empty() && std::chrono::steady_clock::now() - begin < kHandleFor; ++i) {
    Waiting message = std::move(queue_.front());
    queue_.pop_front();
    --message.subscription->status.depth;
    message.subscription->waiting_bytes -= message.bytes.size();
    message.subscription->handler({message.channel, message.bytes, message.received_us});
    if (free_.size() < kMaxFreeBuffers && message.bytes.capacity() <= kMaxFreeBytes) {
      free_.push_back(std::move(message.bytes));
    }
    drain();
  }
  return true;
}

std::vector<QueueStatus> NetworkBus::queues() const {
  std::vector<QueueStatus> all;
  for (const auto& subscription : subscriptions_) {
    all.push_back(subscription->status);
    for (const Waiting& waiting : queue_) {
      if (waiting.subscription != subscription.get()) continue;
      all.back().oldest_us = waiting.received_us;
      break;
    }
  }
  return all;
}

int64_t NetworkBus::kernel_drops() const { return port_ > 0 ? udp_socket_facts(port_).drops : 0; }

int NetworkBus::receive_buffer_bytes() const { return port_ > 0 ? udp_socket_facts(port_).receive_buffer_bytes : 0; }

}  // namespace roadfix
