/// LCM's messages out of its UDP datagrams: a short message is one datagram, a long one comes in fragments.
///
/// The form on the wire (LCM's documentation, "UDP Multicast Protocol"), all numbers big-endian:
///   short     "LC02", sequence u32, channel, 0, bytes
///   fragment  "LC03", sequence u32, size of all u32, offset u32, number u16, how many u16, then in fragment 0 channel
///             and 0, bytes
/// Fragments may come in any order, twice, and mixed with those of other messages and senders. What is no such datagram
/// is counted and nothing else.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace roadfix {

/// Valid until the next take().
struct WireMessage {
  std::string_view channel;
  std::span<const uint8_t> bytes;
};

class Datagrams {
 public:
  /// Bytes of messages that are not complete; beyond it the oldest are given up.
  static constexpr std::size_t kMaxWaitingBytes = std::size_t{16} << 20;

  /// `wanted`: whether anybody listens to a channel; fragments of others are not kept.
  explicit Datagrams(std::function<bool(std::string_view)> wanted) : wanted_(std::move(wanted)) {}

  /// `sender`: its address and port in one number. The message that this datagram is, or completes.
  std::optional<WireMessage> take(uint64_t sender, std::span<const uint8_t> datagram);

  [[nodiscard]] int64_t broken() const { return broken_; }               ///< datagrams that are none of LCM's
  [[nodiscard]] int64_t given_up() const { return given_up_; }           ///< messages of which fragments are missing
  [[nodiscard]] std::size_t waiting() const { return partial_.size(); }  ///< messages that are not complete

 private:
  struct Fragment {
    uint32_t sequence = 0, size = 0, offset = 0;
    uint16_t number = 0, count = 0;
  };
  struct Partial {
    std::string channel;  ///< empty before fragment 0
    std::vector<uint8_t> bytes;
    std::size_t received = 0;  ///< bytes, of all fragments
    std::vector<bool> seen;    ///< fragments
    int64_t begun = 0;         ///< the smaller, the older
  };
  using Key = std::pair<uint64_t, uint32_t>;  ///< sender, sequence

  std::optional<WireMessage> take_short(std::span<const uint8_t> datagram);
  std::optional<WireMessage> take_fragment(uint64_t sender, std::span<const uint8_t> datagram);
  Partial* partial_of(const Key& key, const Fragment& fragment);
  void ignore(const Key& key);
  void give_up(std::map<Key, Partial>::iterator partial);

  std::function<bool(std::string_view)> wanted_;
  std::map<Key, Partial> partial_;
  std::size_t waiting_bytes_ = 0;
  std::map<uint64_t, uint32_t> ignored_;  ///< by sender: the newest sequence of a channel that nobody wants
  Partial complete_;                      ///< what the last result points into
  int64_t begun_ = 0, broken_ = 0, given_up_ = 0;
};

}  // namespace roadfix
