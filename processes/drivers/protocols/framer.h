/// Cuts a device's stream of bytes into frames, in whatever pieces the bytes come, and synchronises again after
/// garbage: behind a wrong checksum the search goes on one byte further, so no garbage costs a whole frame that follows
/// it. Counts what it refuses. No I/O and no clock.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace roadfix {

enum class Fit {
  kNoFrame,      ///< no frame of this protocol begins here
  kIncomplete,   ///< one may begin here; more bytes decide
  kBadChecksum,  ///< one seems to begin here, but its checksum is wrong
  kFrame
};

struct Probe {
  Fit fit = Fit::kNoFrame;
  std::size_t size = 0;  ///< of the whole frame where fit is kFrame
};

/// Whether a frame of one protocol stands at the beginning of `bytes`, which is never empty.
using ProbeFrame = Probe (*)(std::span<const uint8_t> bytes);

struct Frame {
  std::size_t protocol = 0;        ///< index into the framer's protocols
  std::span<const uint8_t> bytes;  ///< the whole frame; valid until the next call
};

class Framer {
 public:
  /// A beginning that is not completed for `timeout_us` was none: it may not hold up the frames behind it for longer.
  static constexpr int64_t kDefaultTimeout_us = 300'000;

  explicit Framer(std::vector<ProbeFrame> protocols, int64_t timeout_us = kDefaultTimeout_us);

  /// More bytes, read at `t_us`.
  void feed(int64_t t_us, std::span<const uint8_t> bytes);

  /// The next whole frame of what was fed so far.
  std::optional<Frame> next();

  /// The stream broke off: what waits for its rest is garbage.
  void reset();

  [[nodiscard]] int64_t frames(std::size_t protocol) const { return counters_[protocol].frames; }
  [[nodiscard]] int64_t bad_checksums(std::size_t protocol) const { return counters_[protocol].bad_checksums; }
  [[nodiscard]] int64_t skipped_bytes() const { return skipped_bytes_; }  ///< that belong to no frame
  [[nodiscard]] std::size_t waiting_bytes() const { return buffer_.size() - begin_; }

 private:
  struct Counters {
    int64_t frames = 0;
    int64_t bad_checksums = 0;
  };

  void skip_byte();

  std::vector<ProbeFrame> protocols_;
  int64_t timeout_us_;
  std::vector<Counters> counters_;
  std::vector<uint8_t> buffer_;
  std::size_t begin_ = 0;  ///< of what is not yet cut
  int64_t now_us_ = 0;
  int64_t begin_since_us_ = 0;  ///< when the byte at begin_ became the first
  int64_t skipped_bytes_ = 0;
};

}  // namespace roadfix
