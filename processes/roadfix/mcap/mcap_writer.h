/// Writes one MCAP file from front to back: chunks packed with zstd, an index of each, statistics, CRCs of everything.
/// Nothing is ever sought back to, so a pipe will do.
#pragma once

#include <functional>
#include <memory>
#include <set>

#include "roadfix/mcap/mcap_format.h"

struct ZSTD_CCtx_s;

namespace roadfix {

class McapWriter {
 public:
  /// Gets the file's bytes in order; what it throws comes through.
  using Sink = std::function<void(std::span<const uint8_t>)>;

  McapWriter(Sink sink, const std::string& profile, const std::string& library);

  /// The schema's id.
  uint16_t add_schema(const McapSchema& schema);
  /// The channel's id.
  uint16_t add_channel(const McapChannel& channel);
  /// Times in ns since 1970.
  void write(uint16_t channel, uint32_t sequence, uint64_t log_time, uint64_t publish_time,
             std::span<const uint8_t> data);
  /// The last chunk, the summary and the end; nothing may follow.
  void finish();

  [[nodiscard]] uint64_t messages() const { return messages_; }

 private:
  struct IndexEntry {
    uint64_t log_time;
    uint64_t offset;
  };
  struct TimeSpan {
    uint64_t first = UINT64_MAX;
    uint64_t last = 0;
    void add(uint64_t time);
    void put(McapFields& fields) const;  ///< both 0 where there is none
  };

  void emit(std::span<const uint8_t> bytes);
  void write_chunk();
  void write_summary();
  std::span<const uint8_t> packed_chunk();

  Sink sink_;
  uint64_t position_ = 0;
  uint32_t crc_ = 0;               ///< of all bytes so far
  McapFields schemas_, channels_;  ///< all records so far, for the summary
  uint16_t num_schemas_ = 0, num_channels_ = 0;
  McapFields chunk_;
  TimeSpan chunk_span_, file_span_;
  std::map<uint16_t, std::vector<IndexEntry>> chunk_index_;
  McapFields chunk_indices_;  ///< ChunkIndex records, for the summary
  uint32_t num_chunks_ = 0;
  std::map<uint16_t, uint64_t> counts_;
  uint64_t messages_ = 0;
  std::vector<uint8_t> packed_;
  std::shared_ptr<ZSTD_CCtx_s> zstd_;
};

}  // namespace roadfix
