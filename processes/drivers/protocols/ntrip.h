/// NTRIP, corrections for GNSS receivers over HTTP: requests to a caster and its answers, without the socket.
/// Facts: RTCM 10410.1 (version 2.0: HTTP/1.1, perhaps chunked) and version 1.0 (answer "ICY 200 OK"). No TLS.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/protocols/framer.h"

namespace roadfix {

struct NtripRequest {
  std::string host;
  int port = 2101;
  std::string mountpoint;
  std::string user;  ///< empty: no authorization
  std::string password;
};
/// The text that opens the stream. Throws std::invalid_argument where a part holds a line end or a blank.
std::string ntrip_request(const NtripRequest& request);

std::string base64(const std::string& text);

class NtripAnswer {
 public:
  enum class State { kWaiting, kStreaming, kRefused };
  /// Bytes of an answer's head, or of the line before a chunk. Counted from its first one, so that it does not matter
  /// in which pieces they come.
  static constexpr std::size_t kMaxHead = 8192;

  NtripAnswer();

  /// Bytes of the caster; gives the whole RTCM 3 frames among them, checked, and nothing else.
  std::vector<uint8_t> feed(int64_t t_us, std::span<const uint8_t> bytes);

  [[nodiscard]] State state() const { return state_; }
  /// Why the caster refused, in its text or ours.
  [[nodiscard]] const std::string& why() const { return reason_; }
  [[nodiscard]] int64_t frames() const { return framer_.frames(0); }
  [[nodiscard]] int64_t bad_checksums() const { return framer_.bad_checksums(0); }
  [[nodiscard]] int64_t skipped_bytes() const { return framer_.skipped_bytes(); }
  /// Kept for what is still to come: never more than a head and a frame.
  [[nodiscard]] std::size_t waiting_bytes() const { return head_.size() + framer_.waiting_bytes(); }

 private:
  void read_head();
  void read_header_line(const std::string& line);
  void refuse(const std::string& why);
  /// Takes the chunks' lengths out of `head_` and leaves what is not whole there.
  std::vector<uint8_t> unchunk();

  State state_ = State::kWaiting;
  std::string reason_;
  std::vector<uint8_t> head_;  ///< received, but not yet understood
  bool version1_ = false;
  bool chunked_ = false;
  std::size_t chunk_left_ = 0;  ///< bytes of the current chunk still to come
  Framer framer_;
};

}  // namespace roadfix
