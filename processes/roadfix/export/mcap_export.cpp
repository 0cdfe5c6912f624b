#include "roadfix/export/mcap_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "bus/log/log_survey.h"
#include "bus/types/message.h"
#include "roadfix/export/foxglove_schemas.h"
#include "roadfix/export/foxglove_views.h"
#include "roadfix/export/lcm_json.h"
#include "roadfix/mcap/mcap_writer.h"

namespace roadfix {
namespace {

uint64_t nanoseconds(int64_t utime) { return utime > 0 ? static_cast<uint64_t>(utime) * 1000U : 0U; }

/// The estimate that the frame `vehicle` hangs on: the best that the log has.
std::string vehicle_channel(LogReader& log) {
  std::set<std::string, std::less<>> channels;
  while (const auto event = log.next()) {
    if (channels.find(event->channel) == channels.end()) channels.emplace(event->channel);
  }
  log.rewind();
  for (const char* channel : {"POSE_FUSED", "POSE_INS", "POSE_LOCAL", "POSE_VO", "POSE_WHEEL"}) {
    if (channels.contains(channel)) return channel;
  }
  return "REFERENCE";
}

class Exporter {
 public:
  Exporter(const ByteSink& sink, std::string vehicle) : writer_(sink, "", "roadfix"), viewer_(std::move(vehicle)) {}

  void add(const LogEvent& event) {
    const Type* type = event.data.size() >= 8 ? type_of(read_int64(event.data.data())) : nullptr;
    const std::string channel(event.channel);
    if (type == nullptr) {
      ++unknown_[channel];
    } else if (type->check(event.data) != CheckResult::kOk) {
      ++broken_[channel];
    } else {
      write(channel, *type, event);
    }
  }

  McapSummary finish() {
    writer_.finish();
    summary_.messages = writer_.messages();
    for (const auto& [channel, count] : unknown_) {
      summary_.notes.push_back(fmt::format("{}: {} messages of no type of ours left out", channel, count));
    }
    for (const auto& [channel, count] : broken_) {
      summary_.notes.push_back(fmt::format("{}: {} undecodable messages left out", channel, count));
    }
    return std::move(summary_);
  }

 private:
  struct Type {
    std::string name;
    MessageCheck check;
    LcmJson json;
    uint16_t schema = 0;
  };

  const Type* type_of(int64_t fingerprint) {
    const auto found = types_.find(fingerprint);
    if (found != types_.end()) return found->second ? &*found->second : nullptr;
    std::optional<Type>& type = types_[fingerprint];
    const Schema& schema = Schema::built_in();
    const auto name = schema.name_of(fingerprint);
    if (!name) return nullptr;
    type.emplace(Type{*name, schema.check_of(*name), LcmJson(schema, *name, *name == "image_t")});
    const std::string& text = type->json.schema_text();
    type->schema = writer_.add_schema({"roadfix." + *name, "jsonschema", {text.begin(), text.end()}});
    return &*type;
  }

  uint16_t channel_of(const std::string& topic, uint16_t schema, const char* encoding) {
    const auto [found, is_new] = channels_.try_emplace({topic, schema});
    if (is_new) found->second = writer_.add_channel({schema, topic, encoding});
    return found->second;
  }

  uint16_t foxglove_schema(const std::string& name) {
    const auto [found, is_new] = foxglove_schemas_.try_emplace(name);
    if (is_new) found->second = writer_.add_schema({"foxglove." + name, "protobuf", foxglove::descriptor_set()});
    return found->second;
  }

  void write(const std::string& channel, const Type& type, const LogEvent& event) {
    const auto header = read_header(event.data);
    const uint64_t logged = nanoseconds(event.timestamp_us);
    const uint64_t published = header ? nanoseconds(header->utime) : logged;
    const auto sequence = header ? static_cast<uint32_t>(header->seq) : 0U;
    text_.clear();
    type.json.write(event.data, text_);
    writer_.write(channel_of("/" + channel, type.schema, "json"), sequence, logged, published,
                  {reinterpret_cast<const uint8_t*>(text_.data()), text_.size()});
    for (const FoxgloveView& view : views(channel, type.name, event.data)) {
      const std::string topic = view.topic.starts_with('/') ? view.topic : "/" + channel + "/" + view.topic;
      writer_.write(channel_of(topic, foxglove_schema(view.schema), "protobuf"), sequence, logged, published,
                    view.message.bytes());
    }
    ++summary_.events;
  }

  FoxgloveViews views(const std::string& channel, const std::string& type, std::span<const uint8_t> data) {
    if (type == "pose_t") return viewer_.views(channel, decode<pose_t>(data));
    if (type == "gnss_t") return viewer_.views(channel, decode<gnss_t>(data));
    if (type == "image_t") return viewer_.views(channel, decode<image_t>(data));
    if (type == "vo_features_t") return viewer_.views(channel, decode<vo_features_t>(data));
    if (type == "health_t") return viewer_.views(channel, decode<health_t>(data));
    if (type == "ledger_t") return viewer_.views(channel, decode<ledger_t>(data));
    if (type == "config_t") return viewer_.views(channel, decode<config_t>(data));
    return {};
  }

  McapWriter writer_;
  FoxgloveViewer viewer_;
  std::map<int64_t, std::optional<Type>> types_;
  std::map<std::pair<std::string, uint16_t>, uint16_t> channels_;
  std::map<std::string, uint16_t> foxglove_schemas_;
  std::map<std::string, int64_t> unknown_, broken_;
  std::string text_;
  McapSummary summary_;
};

}  // namespace

McapSummary write_mcap(LogReader& log, const ByteSink& sink) {
  require_our_log(log);
  Exporter exporter(sink, vehicle_channel(log));
  while (const auto event = log.next()) exporter.add(*event);
  McapSummary summary = exporter.finish();
  for (const LogDamage& damage : log.damage()) {
    summary.notes.push_back(
        fmt::format("{} bytes at offset {} left out: {}", damage.bytes, damage.offset, damage.what));
  }
  return summary;
}

}  // namespace roadfix
