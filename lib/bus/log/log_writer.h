/// Writes LCM event logs that lcm-logplayer and lcm-spy read.
#pragma once

#include <string_view>
#include <vector>

#include "bus/log/log_file.h"
#include "stream/stream_hash.h"

namespace roadfix {

class LogWriter {
 public:
  enum class Mode {
    /// Appears under its name only at commit(); without it nothing stays but, after a kill, PATH.part. A device or pipe
    /// gets the bytes as they come.
    kWhole,
    kRecording  ///< grows under its own name: what was flushed survives a kill
  };

  /// Throws LogError where the file cannot be created, another process is writing it, or kWhole would replace a file
  /// that is no log.
  explicit LogWriter(const std::filesystem::path& path, Mode mode = Mode::kWhole);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /// Throws LogError, also for a full disk and for a channel name that LCM does not take.
  void write(std::string_view channel, int64_t timestamp_us, std::span<const uint8_t> data);

  /// Hands what was written to the system; `to_disk` waits until the disk has it.
  void flush(bool to_disk);

  /// Everything is under its final name when this returns; and on the disk, unless the log is one that is read and
  /// deleted at once.
  void commit(bool to_disk = true);

  [[nodiscard]] int64_t events() const { return events_; }
  [[nodiscard]] uint64_t bytes() const { return bytes_; }
  /// Of all bytes so far, as `xxhsum` computes it.
  [[nodiscard]] uint64_t hash() const { return hash_.value(); }

 private:
  void refuse_non_log() const;
  void put(const void* data, std::size_t size);
  [[nodiscard]] std::size_t write_some(std::span<const uint8_t> data) const;

  std::filesystem::path path_;
  std::filesystem::path written_path_;
  Mode mode_;
  int fd_ = -1;
  std::vector<uint8_t> buffer_;
  int64_t events_ = 0;
  uint64_t bytes_ = 0;
  StreamHash hash_;
};

}  // namespace roadfix
