#include "bus/transport/log_bus.h"

#include "bus/types/message.h"

namespace roadfix {

void LogBus::subscribe(const std::string& channels, Handler handler, const QueuePolicy&) {
  subscriptions_.push_back({std::regex(channels), std::move(handler), {}});
}

void LogBus::publish(const std::string& channel, std::span<const uint8_t> bytes) {
  if (out_ == nullptr) throw BusError(reader_.path().string() + ": a log is read, nothing can be published");
  const std::optional<Header> header = read_header(bytes);
  if (!header) throw BusError(channel + ": a message without utime");
  out_->write(channel, header->utime, bytes);
}

bool LogBus::handle(std::chrono::milliseconds) {
  const std::optional<LogEvent> event = reader_.next();
  if (!event) return false;
  for (Subscription& subscription : subscriptions_) {
    auto match = subscription.matches.find(event->channel);
    if (match == subscription.matches.end()) {
      const std::string channel(event->channel);
      match = subscription.matches.emplace(channel, std::regex_match(channel, subscription.channels)).first;
    }
    if (match->second) subscription.handler({event->channel, event->data, event->timestamp_us});
  }
  return true;
}

}  // namespace roadfix
