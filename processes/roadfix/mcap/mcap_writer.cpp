#include "roadfix/mcap/mcap_writer.h"

#include <zstd.h>

#include <algorithm>
#include <stdexcept>

namespace roadfix {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{1} << 20U;  // a second of a drive: what a reader unpacks to seek
constexpr const char* kZstd = "zstd";
constexpr std::size_t kMessageHead = 2 + 4 + 8 + 8;

}  // namespace

void McapWriter::TimeSpan::add(uint64_t time) {
  first = std::min(first, time);
  last = std::max(last, time);
}

void McapWriter::TimeSpan::put(McapFields& fields) const {
  fields.number(first == UINT64_MAX ? uint64_t{0} : first);
  fields.number(last);
}

McapWriter::McapWriter(Sink sink, const std::string& profile, const std::string& library)
    : sink_(std::move(sink)), zstd_(ZSTD_createCCtx(), ZSTD_freeCCtx) {
  ZSTD_CCtx_setParameter(zstd_.get(), ZSTD_c_compressionLevel, 1);
  emit(kMcapMagic);
  McapFields header;
  header.text(profile);
  header.text(library);
  McapFields record;
  record.record(McapOp::kHeader, header);
  emit(record.bytes());
}

void McapWriter::emit(std::span<const uint8_t> bytes) {
  sink_(bytes);
  position_ += bytes.size();
  crc_ = crc32_of(bytes, crc_);
}

uint16_t McapWriter::add_schema(const McapSchema& schema) {
  McapFields fields;
  fields.number(++num_schemas_);
  fields.text(schema.name);
  fields.text(schema.encoding);
  fields.number(static_cast<uint32_t>(schema.data.size()));
  fields.append(schema.data);
  chunk_.record(McapOp::kSchema, fields);
  schemas_.record(McapOp::kSchema, fields);
  return num_schemas_;
}

uint16_t McapWriter::add_channel(const McapChannel& channel) {
  McapFields fields;
  fields.number(++num_channels_);
  fields.number(channel.schema);
  fields.text(channel.topic);
  fields.text(channel.encoding);
  fields.number(uint32_t{0});  // metadata: none
  chunk_.record(McapOp::kChannel, fields);
  channels_.record(McapOp::kChannel, fields);
  return num_channels_;
}

void McapWriter::write(uint16_t channel, uint32_t sequence, uint64_t log_time, uint64_t publish_time,
                       std::span<const uint8_t> data) {
  chunk_index_[channel].push_back({log_time, chunk_.size()});
  chunk_span_.add(log_time);
  file_span_.add(log_time);
  chunk_.head(McapOp::kMessage, kMessageHead + data.size());
  chunk_.number(channel);
  chunk_.number(sequence);
  chunk_.number(log_time);
  chunk_.number(publish_time);
  chunk_.append(data);
  ++counts_[channel];
  ++messages_;
  if (chunk_.size() >= kChunkBytes) write_chunk();
}

std::span<const uint8_t> McapWriter::packed_chunk() {
  packed_.resize(ZSTD_compressBound(chunk_.size()));
  const std::size_t size =
      ZSTD_compress2(zstd_.get(), packed_.data(), packed_.size(), chunk_.bytes().data(), chunk_.size());
  if (ZSTD_isError(size) != 0) throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
  return std::span(packed_).first(size);
}

void McapWriter::write_chunk() {
  if (chunk_.size() == 0) return;
  const std::span<const uint8_t> packed = packed_chunk();
  McapFields head;
  chunk_span_.put(head);
  head.number(static_cast<uint64_t>(chunk_.size()));
  head.number(crc32_of(chunk_.bytes()));
  head.text(kZstd);
  head.number(static_cast<uint64_t>(packed.size()));
  McapFields record;
  record.head(McapOp::kChunk, head.size() + packed.size());
  record.append(head.bytes());
  const uint64_t chunk_start = position_;
  emit(record.bytes());
  emit(packed);
  const uint64_t chunk_length = position_ - chunk_start;

  McapFields offsets;
  const uint64_t index_start = position_;
  for (const auto& [channel, entries] : chunk_index_) {
    offsets.number(channel);
    offsets.number(position_);
    McapFields index;
    index.number(channel);
    index.number(static_cast<uint32_t>(entries.size() * sizeof(IndexEntry)));
    for (const IndexEntry& entry : entries) {
      index.number(entry.log_time);
      index.number(entry.offset);
    }
    McapFields index_record;
    index_record.record(McapOp::kMessageIndex, index);
    emit(index_record.bytes());
  }

  McapFields index;
  chunk_span_.put(index);
  index.number(chunk_start);
  index.number(chunk_length);
  index.number(static_cast<uint32_t>(offsets.size()));
  index.append(offsets.bytes());
  index.number(position_ - index_start);
  index.text(kZstd);
  index.number(static_cast<uint64_t>(packed.size()));
  index.number(static_cast<uint64_t>(chunk_.size()));
  chunk_indices_.record(McapOp::kChunkIndex, index);
  ++num_chunks_;
  chunk_.clear();
  chunk_index_.clear();
  chunk_span_ = {};
}

void McapWriter::write_summary() {
  McapFields statistics;
  statistics.number(messages_);
  statistics.number(num_schemas_);
  statistics.number(uint32_t{num_channels_});
  statistics.number(uint32_t{0});  // attachments
  statistics.number(uint32_t{0});  // metadata
  statistics.number(num_chunks_);
  file_span_.put(statistics);
  statistics.number(static_cast<uint32_t>(counts_.size() * (sizeof(uint16_t) + sizeof(uint64_t))));
  for (const auto& [channel, count] : counts_) {
    statistics.number(channel);
    statistics.number(count);
  }
  McapFields statistics_record;
  statistics_record.record(McapOp::kStatistics, statistics);

  const uint64_t summary_start = position_;
  McapFields summary;
  McapFields offsets;
  const auto add_group = [&](McapOp op, const McapFields& group) {
    if (group.size() == 0) return;
    McapFields offset;
    offset.number(static_cast<uint8_t>(op));
    offset.number(summary_start + summary.size());
    offset.number(static_cast<uint64_t>(group.size()));
    offsets.record(McapOp::kSummaryOffset, offset);
    summary.append(group.bytes());
  };
  add_group(McapOp::kSchema, schemas_);
  add_group(McapOp::kChannel, channels_);
  add_group(McapOp::kStatistics, statistics_record);
  add_group(McapOp::kChunkIndex, chunk_indices_);
  const uint64_t offsets_start = summary_start + summary.size();
  summary.append(offsets.bytes());
  summary.head(McapOp::kFooter, 8 + 8 + 4);
  summary.number(summary_start);
  summary.number(offsets_start);
  summary.number(crc32_of(summary.bytes()));
  emit(summary.bytes());
}

void McapWriter::finish() {
  write_chunk();
  McapFields end;
  end.number(crc_);
  McapFields record;
  record.record(McapOp::kDataEnd, end);
  emit(record.bytes());
  write_summary();
  emit(kMcapMagic);
}

}  // namespace roadfix
