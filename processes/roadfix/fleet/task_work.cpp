#include "roadfix/fleet/task_work.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>

#include "bus/log/log_reader.h"
#include "bus/run/process_facts.h"
#include "bus/run/replay.h"
#include "config/config_error.h"
#include "evaluation/bounds.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "roadfix/fleet/task_inputs.h"
#include "roadfix/stages.h"
#include "stream/stream_hash.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Wall time of one part after the other.
class Laps {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }
  [[nodiscard]] double total() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point last_ = begin_;
};

bool keeps(const FleetPlan& plan, const std::string& what) {
  return std::find(plan.keep.begin(), plan.keep.end(), what) != plan.keep.end();
}

/// The channels that are the same bits whenever the same build computes from the same inputs; the others describe the
/// run itself.
bool is_output(std::string_view channel) {
  return channel.starts_with("POSE_") || channel.ends_with("_STATUS") || channel.starts_with("AIDING_") ||
         channel.starts_with("PROTECTION_") || channel == "VO_FEATURES" || channel == "FUSION_STATE" ||
         channel == "VO_RESTART";
}

/// XXH64 over the stamps and bytes of each output channel, in the order of the log.
Json output_digests(const fs::path& log) {
  std::map<std::string, StreamHash, std::less<>> hashes;
  LogReader reader(log);
  while (const auto event = reader.next()) {
    if (!is_output(event->channel)) continue;
    const auto found = hashes.find(event->channel);
    StreamHash& hash = found != hashes.end() ? found->second : hashes[std::string(event->channel)];
    hash.add(&event->timestamp_us, sizeof event->timestamp_us);
    hash.add(event->data.data(), event->data.size());
  }
  Json json = Json::object();
  for (const auto& [channel, hash] : hashes) json[channel] = fmt::format("{:016x}", hash.value());
  return json;
}

Json bounds_json(const EvaluationReport& report) {
  Json json = Json::object();
  for (const ChannelScore& channel : report.channels) {
    const BoundHistogram bounds = horizontal_bounds(channel.scored, report.facts.reference.sigma_m);
    Json cells = Json::array();
    for (const auto& [cell, count] : bounds.cells()) cells.push_back({cell.first, cell.second, count});
    json[channel.channel] = {{"bound", "3 sigma, horizontal"},
                             {"samples", bounds.samples()},
                             {"exceeded", bounds.exceeded()},
                             {"cells", std::move(cells)}};
  }
  return json;
}

Json replay_json(const ReplaySummary& summary) {
  Json inputs = Json::array();
  for (const ReplaySummary::Input& input : summary.inputs) {
    const InputCounters& c = input.counters;
    if (c.lost + c.late + c.undecodable + c.refused + c.duplicate == 0) continue;
    inputs.push_back({{"stage", input.stage},
                      {"channel", input.channel},
                      {"lost", c.lost},
                      {"late", c.late},
                      {"undecodable", c.undecodable},
                      {"refused", c.refused},
                      {"duplicate", c.duplicate}});
  }
  return {{"messages", summary.messages},
          {"outputs", summary.outputs},
          {"data_s", summary.data_s},
          {"damaged_places", summary.damage.size()},
          {"exceptions", std::move(inputs)}};
}

EvaluationRequest request_of(const FleetPlan& plan, const fs::path& log) {
  EvaluationRequest request;
  request.log = log;
  request.channels = plan.channels;
  request.options.fit_delay = plan.fit_delay;
  for (const auto& [channel, name] : plan.alignments) request.alignments[channel] = alignment_named(name);
  return request;
}

void move_file(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (!error) return;
  fs::copy_file(from, to, fs::copy_options::overwrite_existing, error);  // another file system
  if (error) throw ConfigError(to.string(), 0, "cannot be written: " + error.message());
}

void keep_files(const FleetPlan& plan, const EvaluationReport& report, const TaskInputs& inputs,
                const fs::path& outputs, const fs::path& folder) {
  if (keeps(plan, "report")) write_text_file(folder / "report" / "report.html", report_page(report));
  if (keeps(plan, "errors")) {
    for (const ChannelScore& c : report.channels)
      write_text_file(folder / "report" / (c.channel + "_errors.csv"), errors_csv(c));
  }
  if (keeps(plan, "outputs")) move_file(outputs, folder / "out.lcm");
  if (keeps(plan, "drive")) fs::copy_file(inputs.log, folder / "drive.lcm", fs::copy_options::overwrite_existing);
}

Json key_json(const TaskKey& key) {
  return {{"input", key.input}, {"config", key.config}, {"build", key.build}, {"request", key.request}};
}

/// What the process took so far; it does one task.
Json cost_json(const Laps& laps) {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return {{"wall_s", laps.total()},
          {"cpu_s", seconds(usage.ru_utime) + seconds(usage.ru_stime)},
          {"max_rss_mb", static_cast<double>(usage.ru_maxrss) / 1024.0}};
}

}  // namespace

TaskKey task_key(const FleetPlan& plan, const FleetTask& task) {
  const FleetDrive drive = parse_drive(task.words, root_here(plan));
  return {input_digest(drive), config_digest(plan.configs.at(task.config), root_here(plan)), build_id(),
          request_digest(plan, task)};
}

bool is_done(const RunFolder& run, const FleetPlan& plan, const FleetTask& task) {
  const std::optional<ResultHead> head = run.head(task.index);
  if (!head || !head->ok) return false;
  const TaskKey now{head->key.input, plan.configs.at(task.config).digest, plan.build, request_digest(plan, task)};
  if (head->key != now) return false;
  const FleetDrive drive = parse_drive(task.words, root_here(plan));
  return input_stamp(drive) == head->input_stamp || input_digest(drive) == head->key.input;
}

Json do_task(const RunFolder& run, const FleetPlan& plan, const FleetTask& task, const TaskKey& key,
             const fs::path& scratch) {
  Laps laps;
  const FleetDrive drive = parse_drive(task.words, root_here(plan));
  const std::string stamp = input_stamp(drive);
  const TaskInputs inputs = make_inputs(plan, task, drive, scratch);
  const double input_s = laps.lap();
  const fs::path outputs = scratch / "out.lcm";
  ReplayOptions scratch_log;
  scratch_log.to_disk = false;
  const ReplaySummary replayed = replay(inputs.log, outputs, make_stages(plan.stages, inputs.vehicle), scratch_log);
  const double replay_s = laps.lap();
  const EvaluationReport report = evaluate_log(request_of(plan, outputs));
  Json figures = report_json(report);
  figures["bounds"] = bounds_json(report);
  figures["digests"] = output_digests(outputs);
  figures["replay"] = replay_json(replayed);
  keep_files(plan, report, inputs, outputs, run.task_folder(task.index));
  const double evaluate_s = laps.lap();
  Json cost = cost_json(laps);
  cost["input_s"] = input_s;
  cost["replay_s"] = replay_s;
  cost["evaluate_s"] = evaluate_s;
  cost["drive_s"] = replayed.data_s;
  return {{"status", "ok"},
          {"key", key_json(key)},
          {"input_stamp", stamp},
          {"cost", std::move(cost)},
          {"versions", {{"build", build_id()}, {"libraries", library_versions()}, {"cpu", cpu_features()}}},
          {"figures", std::move(figures)}};
}

}  // namespace roadfix
