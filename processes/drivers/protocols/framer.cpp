#include "drivers/protocols/framer.h"

#include <utility>

namespace roadfix {

Framer::Framer(std::vector<ProbeFrame> protocols, int64_t timeout_us)
    : protocols_(std::move(protocols)), timeout_us_(timeout_us), counters_(protocols_.size()) {}

void Framer::feed(int64_t t_us, std::span<const uint8_t> bytes) {
  const bool was_waiting = waiting_bytes() > 0;
  now_us_ = t_us;
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
  begin_ = 0;
  if (!was_waiting) begin_since_us_ = t_us;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
}

std::optional<Frame> Framer::next() {
  while (begin_ < buffer_.size()) {
    const std::span<const uint8_t> rest(buffer_.data() + begin_, buffer_.size() - begin_);
    bool incomplete = false;
    for (std::size_t i = 0; i < protocols_.size(); ++i) {
      const Probe probe = protocols_[i](rest);
      if (probe.fit == Fit::kFrame) {
        ++counters_[i].frames;
        begin_ += probe.size;
        begin_since_us_ = now_us_;
        return Frame{i, rest.first(probe.size)};
      }
      if (probe.fit == Fit::kBadChecksum) ++counters_[i].bad_checksums;
      if (probe.fit == Fit::kIncomplete) incomplete = true;
    }
    if (incomplete && now_us_ - begin_since_us_ <= timeout_us_) return std::nullopt;
    skip_byte();
  }
  return std::nullopt;
}

void Framer::skip_byte() {
  ++begin_;
  ++skipped_bytes_;
  begin_since_us_ = now_us_;
}

void Framer::reset() {
  skipped_bytes_ += static_cast<int64_t>(waiting_bytes());
  buffer_.clear();
  begin_ = 0;
}

}  // namespace roadfix
