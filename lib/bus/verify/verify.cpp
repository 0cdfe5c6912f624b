#include "bus/verify/verify.h"

#include <algorithm>
#include <set>

#include "bus/log/log_survey.h"
#include "bus/run/stage_runner.h"
#include "bus/verify/output_difference.h"

namespace roadfix {

namespace {

/// For a runner that is only asked what it runs with.
struct NoSink : MessageSink {
  void put(const std::string&, const Header&, std::span<const uint8_t>) override {}
};

std::set<std::string> channels_of(const StageSpec& spec) {
  std::set<std::string> channels;
  for (const InputSpec& input : spec.inputs) channels.insert(input.channel);
  for (const OutputSpec& output : spec.outputs) channels.insert(output.channel);
  for (const char* prefix : {"LEDGER_", "STATE_", "CONFIG_"}) channels.insert(stage_channel(prefix, spec.name));
  return channels;
}

std::vector<std::string> compare_configs(const StageSpec& spec, const config_t& here,
                                         const std::vector<LogReader*>& readers, const LogIndex& index) {
  std::vector<std::string> differences;
  const int channel = index.channel(stage_channel("CONFIG_", spec.name));
  const MessageCheck check = Schema::built_in().check_of("config_t");
  bool any = false;
  for (const IndexedMessage& message : index.messages) {
    if (message.channel != channel) continue;
    const std::span<const uint8_t> bytes = readers[static_cast<std::size_t>(message.file)]->at(message.offset).data;
    if (check(bytes) != CheckResult::kOk) continue;
    any = true;
    for (const std::string& difference : config_differences(decode<config_t>(bytes), here)) {
      if (std::find(differences.begin(), differences.end(), difference) == differences.end()) {
        differences.push_back(difference);
      }
    }
  }
  if (!any) differences.emplace_back("the log does not tell the car's build and configuration");
  return differences;
}

StageVerdict verify_stage(const NewStage& new_stage, const std::vector<LogReader*>& readers) {
  const std::unique_ptr<Stage> stage = new_stage();
  const StageSpec spec = stage->spec();
  const std::set<std::string> channels = channels_of(spec);
  LogIndex index =
      index_logs(readers, [&](std::string_view channel) { return channels.contains(std::string(channel)); });
  if (readers.size() > 1) remove_duplicates(index, readers);
  StageVerdict verdict;
  verdict.stage = spec.name;
  StageLog log = collect_stage_log(spec, readers, index);
  if (log.runs.empty()) return verdict;
  NoSink sink;
  const config_t here = StageRunner(new_stage(), sink).config_message();
  verdict.config_differences = compare_configs(spec, here, readers, index);
  verdict.damage = log.damage;
  for (auto& [name, run] : log.runs) verdict.runs.push_back(verify_run(new_stage, spec, log, name, run));
  return verdict;
}

template <class Count>
int64_t sum(const std::vector<RunVerdict>& runs, Count count) {
  int64_t total = 0;
  for (const RunVerdict& run : runs) total += run.*count;
  return total;
}

}  // namespace

int64_t StageVerdict::identical() const { return sum(runs, &RunVerdict::identical); }
int64_t StageVerdict::differing() const { return sum(runs, &RunVerdict::differing); }
int64_t StageVerdict::unverifiable() const { return sum(runs, &RunVerdict::unverifiable); }

VerifyReport verify(const std::vector<std::filesystem::path>& logs, const std::vector<NewStage>& stages) {
  std::vector<std::unique_ptr<LogReader>> held;
  std::vector<LogReader*> readers;
  for (const std::filesystem::path& path : logs) {
    held.push_back(std::make_unique<LogReader>(path));
    readers.push_back(held.back().get());
  }
  VerifyReport report;
  for (const NewStage& stage : stages) {
    StageVerdict verdict = verify_stage(stage, readers);
    if (!verdict.runs.empty()) report.stages.push_back(std::move(verdict));
  }
  if (report.stages.empty()) {
    for (LogReader* reader : readers) require_our_log(*reader);
  }
  for (const LogReader* reader : readers) {
    for (const LogDamage& damage : reader->damage()) {
      report.log_damage.push_back(reader->path().string() + ", byte " + std::to_string(damage.offset) + ": " +
                                  std::to_string(damage.bytes) + " bytes: " + damage.what);
    }
  }
  return report;
}

}  // namespace roadfix
