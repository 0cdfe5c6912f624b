#include "bus/transport/datagrams.h"

#include <algorithm>
#include <cstring>

#include "bus/log/log_file.h"
#include "bus/types/message.h"

namespace roadfix {

namespace {

constexpr uint32_t kShort = 0x4c433032, kLong = 0x4c433033;  // "LC02", "LC03"
constexpr std::size_t kShortHead = 8, kLongHead = 20;
constexpr std::size_t kMaxDatagram = 65507;  // what UDP over IPv4 carries
/// A sender finishes one message before the next; so far behind its newest one, what is missing will not come.
constexpr int32_t kBehind = 8;
/// Senders to remember; whoever makes up more of them only makes us look at more fragments.
constexpr std::size_t kMaxSenders = 1024;

uint32_t read_u32(std::span<const uint8_t> bytes, std::size_t at) {
  return (uint32_t{bytes[at]} << 24) | (uint32_t{bytes[at + 1]} << 16) | (uint32_t{bytes[at + 2]} << 8) | bytes[at + 3];
}

uint16_t read_u16(std::span<const uint8_t> bytes, std::size_t at) {
  return static_cast<uint16_t>((bytes[at] << 8) | bytes[at + 1]);
}

/// The channel's name, which ends with a zero; nothing where there is none.
std::optional<std::string_view> read_channel(std::span<const uint8_t> bytes) {
  const auto end = std::find(
      bytes.begin(), bytes.begin() + std::min<std::ptrdiff_t>(std::ssize(bytes), kMaxChannelBytes + 1), uint8_t{0});
  const auto size = static_cast<std::size_t>(end - bytes.begin());
  if (size == 0 || size > kMaxChannelBytes || size == bytes.size()) return std::nullopt;
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), size);
}

}  // namespace

std::optional<WireMessage> Datagrams::take(uint64_t sender, std::span<const uint8_t> datagram) {
  if (datagram.size() >= kShortHead && read_u32(datagram, 0) == kShort) return take_short(datagram);
  if (datagram.size() >= kLongHead && read_u32(datagram, 0) == kLong) return take_fragment(sender, datagram);
  ++broken_;
  return std::nullopt;
}

std::optional<WireMessage> Datagrams::take_short(std::span<const uint8_t> datagram) {
  const std::span<const uint8_t> rest = datagram.subspan(kShortHead);
  const std::optional<std::string_view> channel = read_channel(rest);
  if (!channel) {
    ++broken_;
    return std::nullopt;
  }
  if (!wanted_(*channel)) return std::nullopt;
  return WireMessage{*channel, rest.subspan(channel->size() + 1)};
}

std::optional<WireMessage> Datagrams::take_fragment(uint64_t sender, std::span<const uint8_t> datagram) {
  const Fragment fragment{read_u32(datagram, 4), read_u32(datagram, 8), read_u32(datagram, 12), read_u16(datagram, 16),
                          read_u16(datagram, 18)};
  std::span<const uint8_t> rest = datagram.subspan(kLongHead);
  std::optional<std::string_view> channel;
  if (fragment.number == 0) {
    channel = read_channel(rest);
    rest = rest.subspan(channel ? channel->size() + 1 : 0);
  }
  const bool sound = fragment.number < fragment.count && (fragment.number > 0 || channel) &&
                     fragment.size <= std::min(kMaxMessageBytes, fragment.count * kMaxDatagram) &&
                     fragment.offset <= fragment.size && rest.size() <= fragment.size - fragment.offset;
  if (!sound) {
    ++broken_;
    return std::nullopt;
  }
  const Key key{sender, fragment.sequence};
  const auto ignored = ignored_.find(sender);
  if (ignored != ignored_.end() && ignored->second == fragment.sequence) return std::nullopt;
  if (channel && !wanted_(*channel)) {
    ignore(key);
    return std::nullopt;
  }
  Partial* partial = partial_of(key, fragment);
  if (partial == nullptr || partial->seen[fragment.number]) return std::nullopt;
  if (channel) partial->channel = *channel;
  partial->seen[fragment.number] = true;
  std::copy(rest.begin(), rest.end(), partial->bytes.begin() + fragment.offset);
  partial->received += rest.size();
  if (std::find(partial->seen.begin(), partial->seen.end(), false) != partial->seen.end()) return std::nullopt;
  waiting_bytes_ -= partial->bytes.size();
  complete_ = std::move(*partial);
  partial_.erase(key);
  if (complete_.received == complete_.bytes.size()) return WireMessage{complete_.channel, complete_.bytes};
  ++broken_;  // fragments that leave a hole, or lie over each other
  return std::nullopt;
}

/// The message that a fragment belongs to; nothing where it contradicts the others of its message.
Datagrams::Partial* Datagrams::partial_of(const Key& key, const Fragment& fragment) {
  auto found = partial_.find(key);
  if (found != partial_.end()) {
    if (found->second.bytes.size() == fragment.size && found->second.seen.size() == fragment.count)
      return &found->second;
    give_up(found);
    ++broken_;
    return nullptr;
  }
  for (auto old = partial_.lower_bound({key.first, 0}); old != partial_.end() && old->first.first == key.first;) {
    const auto next = std::next(old);
    if (static_cast<int32_t>(key.second - old->first.second) > kBehind) give_up(old);  // the count may wrap
    old = next;
  }
  while (!partial_.empty() && waiting_bytes_ + fragment.size > kMaxWaitingBytes) {
    give_up(std::min_element(partial_.begin(), partial_.end(),
                             [](const auto& a, const auto& b) { return a.second.begun < b.second.begun; }));
  }
  Partial& partial = partial_[key];
  partial.bytes.resize(fragment.size);
  partial.seen.resize(fragment.count);
  partial.begun = begun_++;
  waiting_bytes_ += fragment.size;
  return &partial;
}

void Datagrams::ignore(const Key& key) {
  if (const auto partial = partial_.find(key); partial != partial_.end()) {
    waiting_bytes_ -= partial->second.bytes.size();
    partial_.erase(partial);
  }
  if (ignored_.size() >= kMaxSenders) ignored_.clear();
  ignored_[key.first] = key.second;
}

void Datagrams::give_up(std::map<Key, Partial>::iterator partial) {
  waiting_bytes_ -= partial->second.bytes.size();
  partial_.erase(partial);
  ++given_up_;
}

}  // namespace roadfix
