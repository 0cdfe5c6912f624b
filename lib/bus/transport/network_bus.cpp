#include "bus/transport/network_bus.h"

#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <lcm/lcm-cpp.hpp>
#include <new>
#include <system_error>

#include "bus/log/log_file.h"
#include "bus/transport/datagrams.h"
#include "bus/transport/group_socket.h"
#include "bus/transport/udp_socket.h"
#include "bus/types/message.h"

namespace roadfix {

namespace {

/// Datagrams read before the first message of theirs is handled; the rest stays in the kernel's buffer.
constexpr int kDrainAtOnce = 1000;
/// Messages and time handled before the caller gets its turn (heartbeats, the watchdog), however many wait.
constexpr int kHandleAtOnce = 1000;
constexpr auto kHandleFor = std::chrono::milliseconds(100);
constexpr std::size_t kMaxFreeBuffers = 64;
/// Of one that is kept: a buffer never shrinks, so in the end each would be as large as the largest message ever.
constexpr std::size_t kMaxFreeBytes = 1 << 10;
/// The kernel's default buffer holds 160 small messages and more: a second's worth of them for every 200 ms.
constexpr auto kKeeperPeriod = std::chrono::milliseconds(20);
/// Whoever makes up more channels than any vehicle has only makes us compare names again.
constexpr std::size_t kMaxRoutes = 4096;

[[noreturn]] void cannot_open(const std::string& url, const std::string& why) {
  throw BusError("cannot open the bus " + url + (why.empty() ? "" : " (" + why + ")") +
                 ": `roadfix doctor` tells what it lacks (a multicast route, mostly)");
}

BusUrl parsed(const std::string& url) {
  try {
    return parse_bus_url(url);
  } catch (const std::invalid_argument& e) {
    cannot_open(url, e.what());
  }
}

}  // namespace

NetworkBus::NetworkBus(const std::string& url) : url_(parsed(url)), lcm_(std::make_unique<lcm::LCM>(url)) {
  if (!lcm_->good()) cannot_open(url, "");
}

NetworkBus::~NetworkBus() = default;

void NetworkBus::subscribe(const std::string& channels, Handler handler, const QueuePolicy& policy) {
  auto subscription = std::make_unique<Subscription>();
  try {
    subscription->channels = std::regex(channels);
  } catch (const std::regex_error&) {
    throw BusError("cannot subscribe to '" + channels + "'");
  }
  subscription->handler = std::move(handler);
  subscription->policy = policy;
  {
    const std::lock_guard lock(mutex_);
    subscriptions_.push_back(std::move(subscription));
    routes_.clear();
  }
  if (!socket_) begin_to_receive();
}

void NetworkBus::begin_to_receive() {
  const int asked = url_.receive_buffer_bytes > 0 ? url_.receive_buffer_bytes : kReceiveBufferBytes;
  try {
    socket_ = std::make_unique<GroupSocket>(url_, asked);
  } catch (const std::system_error& e) {
    cannot_open(url_.group, e.what());
  }
  datagrams_ = std::make_unique<Datagrams>([this](std::string_view channel) { return !route(channel).empty(); });
  // Signals are for the thread that handles: they end its waiting.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  keeper_ = std::jthread([this](const std::stop_token& stop) { keep_drained(stop); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

void NetworkBus::publish(const std::string& channel, std::span<const uint8_t> bytes) {
  if (channel.empty() || channel.size() > kMaxChannelBytes) throw BusError("no channel name: '" + channel + "'");
  if (bytes.size() > kMaxMessageBytes) throw BusError(channel + ": " + std::to_string(bytes.size()) + " bytes");
  // Of a message in several datagrams LCM says that it was sent even where the system refused them; errno does not.
  errno = 0;
  if (lcm_->publish(channel, bytes.data(), static_cast<unsigned>(bytes.size())) != 0 || errno != 0) ++unsent_;
}

/// Who listens to a channel, in the order of subscribe().
const NetworkBus::Route& NetworkBus::route(std::string_view channel) {
  if (const auto known = routes_.find(channel); known != routes_.end()) return known->second;
  if (routes_.size() >= kMaxRoutes) routes_.clear();
  Route route;
  for (const auto& subscription : subscriptions_) {
    if (std::regex_match(channel.begin(), channel.end(), subscription->channels)) route.push_back(subscription.get());
  }
  return routes_.emplace(channel, std::move(route)).first->second;
}

void NetworkBus::put(Subscription& subscription, std::string_view channel, int64_t received_us,
                     std::span<const uint8_t> bytes) {
  ++subscription.status.received;
  if (subscription.waiting_bytes + bytes.size() > subscription.policy.max_bytes) {
    ++subscription.status.dropped;
    return;
  }
  std::vector<uint8_t> copy;
  if (!free_.empty()) {
    copy = std::move(free_.back());
    free_.pop_back();
  }
  copy.assign(bytes.begin(), bytes.end());
  queue_.push_back({&subscription, std::string(channel), received_us, std::move(copy)});
  subscription.waiting_bytes += bytes.size();
  ++subscription.status.depth;
}

void NetworkBus::drain() {
  const std::lock_guard lock(mutex_);
  drain_locked();
}

/// All that the kernel holds, into the queue.
void NetworkBus::drain_locked() {
  for (int i = 0; i < kDrainAtOnce; ++i) {
    const std::optional<Datagram> datagram = socket_->receive();
    if (!datagram) return;
    const std::optional<WireMessage> message = datagrams_->take(datagram->sender, datagram->bytes);
    if (!message) continue;
    for (Subscription* subscription : route(message->channel)) {
      try {
        put(*subscription, message->channel, datagram->received_us, message->bytes);
      } catch (const std::bad_alloc&) {
        ++subscription->status.dropped;
      }
    }
  }
}

/// For as long as a handler takes its time, or nobody handles: as LCM's thread would. Never while handle() waits at the
/// socket: it would not learn of what was taken away there.
void NetworkBus::keep_drained(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!keeper_waits_.wait_for(lock, stop, kKeeperPeriod, [&] { return stop.stop_requested(); })) {
    if (!attended_) drain_locked();
  }
}

/// Whether to wait at the socket: nothing is in the queue. From here on the keeper stays away.
bool NetworkBus::attend() {
  const std::lock_guard lock(mutex_);
  attended_ = queue_.empty();
  return attended_;
}

/// Until something is in the queue, for `patience` at most, or until a signal.
void NetworkBus::wait(std::chrono::milliseconds patience) {
  using Clock = std::chrono::steady_clock;
  const auto until = Clock::now() + patience;
  auto left = patience;
  while (attend()) {
    const bool undisturbed = socket_->wait(std::max(left, std::chrono::milliseconds::zero()));
    drain();
    if (!undisturbed || left <= std::chrono::milliseconds::zero()) break;
    left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
  }
  const std::lock_guard lock(mutex_);
  attended_ = false;
}

std::optional<NetworkBus::Waiting> NetworkBus::next() {
  const std::lock_guard lock(mutex_);
  if (queue_.empty()) return std::nullopt;
  Waiting message = std::move(queue_.front());
  queue_.pop_front();
  --message.subscription->status.depth;
  message.subscription->waiting_bytes -= message.bytes.size();
  return message;
}

bool NetworkBus::handle(std::chrono::milliseconds patience) {
  if (!socket_) {
    std::this_thread::sleep_for(patience);
    return true;
  }
  wait(patience);
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kHandleAtOnce && std::chrono::steady_clock::now() - begin < kHandleFor; ++i) {
    std::optional<Waiting> message = next();
    if (!message) break;
    message->subscription->handler({message->channel, message->bytes, message->received_us});
    if (message->bytes.capacity() <= kMaxFreeBytes) {
      const std::lock_guard lock(mutex_);
      if (free_.size() < kMaxFreeBuffers) free_.push_back(std::move(message->bytes));
    }
    drain();
  }
  return true;
}

std::vector<QueueStatus> NetworkBus::queues() const {
  const std::lock_guard lock(mutex_);
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

int64_t NetworkBus::kernel_drops() const { return socket_ ? udp_socket_facts(url_.port).drops : 0; }

int NetworkBus::receive_buffer_bytes() const { return socket_ ? udp_socket_facts(url_.port).receive_buffer_bytes : 0; }

}  // namespace roadfix
