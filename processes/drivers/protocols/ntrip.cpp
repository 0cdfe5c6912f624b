#include "drivers/protocols/ntrip.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "drivers/protocols/rtcm.h"

namespace roadfix {

namespace {

constexpr std::size_t kMaxChunk = std::size_t{1} << 20;
constexpr int64_t kRtcmTimeout_us = 5'000'000;  // a caster may pause within a frame

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

void check_word(const char* what, const std::string& word) {
  for (const char c : word)
    if (c <= ' ' || c == '\x7f') throw std::invalid_argument(std::string("ntrip: ") + what + " holds a blank");
}

}  // namespace

std::string base64(const std::string& text) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < text.size(); i += 3) {
    const std::size_t n = std::min<std::size_t>(3, text.size() - i);
    unsigned group = 0;
    for (std::size_t j = 0; j < 3; ++j) group = (group << 8U) | (j < n ? static_cast<unsigned char>(text[i + j]) : 0U);
    for (std::size_t j = 0; j < 4; ++j) out += j <= n ? kDigits[(group >> (18 - 6 * j)) & 63U] : '=';
  }
  return out;
}

std::string ntrip_request(const NtripRequest& r) {
  check_word("host", r.host);
  check_word("mountpoint", r.mountpoint);
  check_word("user", r.user);
  std::string text = "GET /" + r.mountpoint + " HTTP/1.1\r\nHost: " + r.host + ":" + std::to_string(r.port) +
                     "\r\nNtrip-Version: Ntrip/2.0\r\nUser-Agent: NTRIP roadfix\r\n";
  if (!r.user.empty()) text += "Authorization: Basic " + base64(r.user + ":" + r.password) + "\r\n";
  return text + "Connection: close\r\n\r\n";
}

NtripAnswer::NtripAnswer() : framer_({probe_rtcm}, kRtcmTimeout_us) {}

void NtripAnswer::refuse(const std::string& why) {
  state_ = State::kRefused;
  reason_ = why;
  head_.clear();
}

std::vector<uint8_t> NtripAnswer::feed(int64_t t_us, std::span<const uint8_t> bytes) {
  if (state_ == State::kRefused) return {};
  head_.insert(head_.end(), bytes.begin(), bytes.end());
  if (state_ == State::kWaiting) read_head();
  std::vector<uint8_t> corrections;
  if (state_ != State::kStreaming) return corrections;
  framer_.feed(t_us, chunked_ ? unchunk() : std::exchange(head_, {}));
  while (const auto frame = framer_.next())
    corrections.insert(corrections.end(), frame->bytes.begin(), frame->bytes.end());
  return corrections;
}

/// Version 1 answers one line; version 2 a head of HTTP, which ends with an empty line.
void NtripAnswer::read_head() {
  const std::string_view text(reinterpret_cast<const char*>(head_.data()), std::min(head_.size(), kMaxHead));
  const std::size_t line_end = text.find("\r\n");
  if (line_end == std::string_view::npos) {
    if (text.size() == kMaxHead) refuse("answers no line");
    return;
  }
  const std::string first(text.substr(0, std::min<std::size_t>(line_end, 80)));
  std::size_t end = line_end + 2;
  version1_ = first.starts_with("ICY 200");
  if (first.starts_with("SOURCETABLE")) return refuse("there is no such mountpoint (it sent its table)");
  if (!version1_) {
    if (!first.starts_with("HTTP/1.") || first.size() < 12 || first.compare(9, 3, "200") != 0) return refuse(first);
    const std::size_t head_end = text.find("\r\n\r\n");
    if (head_end == std::string_view::npos) {
      if (text.size() == kMaxHead) refuse("its head does not end");
      return;
    }
    for (std::size_t at = end; at < head_end;) {
      const std::size_t next = std::min(text.find("\r\n", at), head_end);
      read_header_line(std::string(text.substr(at, next - at)));
      at = next + 2;
    }
    if (state_ == State::kRefused) return;
    end = head_end + 4;
  }
  state_ = State::kStreaming;
  head_.erase(head_.begin(), head_.begin() + static_cast<std::ptrdiff_t>(end));
}

void NtripAnswer::read_header_line(const std::string& line) {
  const std::string text = lower(line);
  if (text.starts_with("transfer-encoding:") && text.find("chunked") != std::string::npos) chunked_ = true;
  if (text.starts_with("content-type:") && text.find("sourcetable") != std::string::npos) {
    refuse("there is no such mountpoint (it sent its table)");
  }
}

/// Chunks: length in hex, perhaps ";extension", line end, bytes, line end (RFC 9112, 7.1).
std::vector<uint8_t> NtripAnswer::unchunk() {
  std::vector<uint8_t> out;
  std::size_t at = 0;
  while (at < head_.size()) {
    if (chunk_left_ > 2) {  // the two last ones are the line end
      const std::size_t n = std::min(chunk_left_ - 2, head_.size() - at);
      out.insert(out.end(), head_.begin() + static_cast<std::ptrdiff_t>(at),
                 head_.begin() + static_cast<std::ptrdiff_t>(at + n));
      at += n;
      chunk_left_ -= n;
      continue;
    }
    if (chunk_left_ > 0) {
      ++at;
      --chunk_left_;
      continue;
    }
    const std::string_view rest(reinterpret_cast<const char*>(head_.data()) + at,
                                std::min(head_.size() - at, kMaxHead));
    const std::size_t line_end = rest.find("\r\n");
    if (line_end == std::string_view::npos) {
      if (rest.size() == kMaxHead) refuse("sends chunks without a length");
      break;
    }
    std::size_t length = 0;
    const auto parsed = std::from_chars(rest.data(), rest.data() + line_end, length, 16);
    if (parsed.ec != std::errc() || length > kMaxChunk || length == 0) {
      refuse(length == 0 && parsed.ec == std::errc() ? "ended the stream" : "sends a chunk of no length");
      break;
    }
    at += line_end + 2;
    chunk_left_ = length + 2;
  }
  if (state_ != State::kRefused) head_.erase(head_.begin(), head_.begin() + static_cast<std::ptrdiff_t>(at));
  return out;
}

}  // namespace roadfix
