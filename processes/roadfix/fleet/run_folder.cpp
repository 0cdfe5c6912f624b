#include "roadfix/fleet/run_folder.h"

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>

#include "config/config_error.h"
#include "roadfix/fleet/input_digest.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kFormat = 1;

Json json_of(const FleetPlan& plan) {
  Json configs = Json::array();
  for (const FleetConfig& config : plan.configs) configs.push_back({{"path", config.path}, {"digest", config.digest}});
  return {{"format", kFormat},
          {"build", plan.build},
          {"tasks", plan.tasks},
          {"stages", plan.stages},
          {"configs", std::move(configs)},
          {"channels", plan.channels},
          {"alignments", plan.alignments},
          {"fit_delay", plan.fit_delay},
          {"keep", plan.keep},
          {"root", plan.root.string()},
          {"scratch", plan.scratch.string()},
          {"stage_in", plan.stage_in},
          {"time_limit_s", plan.time_limit_s},
          {"min_free_mb", plan.min_free_mb},
          {"threads", plan.threads}};
}

FleetPlan plan_of(const Json& json) {
  if (json.at("format") != kFormat) throw std::runtime_error("format is not " + std::to_string(kFormat));
  FleetPlan plan;
  json.at("build").get_to(plan.build);
  json.at("tasks").get_to(plan.tasks);
  json.at("stages").get_to(plan.stages);
  for (const Json& config : json.at("configs")) plan.configs.push_back({config.at("path"), config.at("digest")});
  json.at("channels").get_to(plan.channels);
  json.at("alignments").get_to(plan.alignments);
  json.at("fit_delay").get_to(plan.fit_delay);
  json.at("keep").get_to(plan.keep);
  plan.root = json.at("root").get<std::string>();
  plan.scratch = json.at("scratch").get<std::string>();
  json.at("stage_in").get_to(plan.stage_in);
  json.at("time_limit_s").get_to(plan.time_limit_s);
  json.at("min_free_mb").get_to(plan.min_free_mb);
  json.at("threads").get_to(plan.threads);
  return plan;
}

Json json_of(const FleetTask& task) {
  return {{"index", task.index}, {"name", task.name}, {"words", task.words}, {"config", task.config}};
}

FleetTask task_of(const std::string& line) {
  const Json json = Json::parse(line);
  return {json.at("index"), json.at("name"), json.at("words"), json.at("config")};
}

/// Reads a result.json up to its figures, and no further.
class HeadReader : public nlohmann::json_sax<Json> {
 public:
  explicit HeadReader(ResultHead& head) : head_(head) {}
  [[nodiscard]] bool complete() const { return complete_; }

  bool key(string_t& name) override {
    if (depth_ == 1) {
      group_ = name;
      if (name == "figures") complete_ = true;
    }
    key_ = name;
    return !complete_;
  }
  bool string(string_t& value) override {
    if (depth_ == 1 && key_ == "status") head_.ok = value == "ok";
    if (depth_ == 1 && key_ == "reason") head_.reason = value;
    if (depth_ == 1 && key_ == "input_stamp") head_.input_stamp = value;
    if (depth_ != 2 || group_ != "key") return true;
    if (key_ == "input") head_.key.input = value;
    if (key_ == "config") head_.key.config = value;
    if (key_ == "build") head_.key.build = value;
    if (key_ == "request") head_.key.request = value;
    return true;
  }
  bool number_float(number_float_t value, const string_t& /*text*/) override { return number(value); }
  bool number_integer(number_integer_t value) override { return number(static_cast<double>(value)); }
  bool number_unsigned(number_unsigned_t value) override { return number(static_cast<double>(value)); }
  bool start_object(std::size_t /*size*/) override { return ++depth_ < 4; }
  bool end_object() override { return --depth_ >= 0; }
  bool start_array(std::size_t /*size*/) override { return ++depth_ < 4; }
  bool end_array() override { return --depth_ >= 0; }
  bool null() override { return true; }
  bool boolean(bool /*value*/) override { return true; }
  bool binary(binary_t& /*value*/) override { return false; }
  bool parse_error(std::size_t /*at*/, const std::string& /*token*/,
                   const nlohmann::detail::exception& /*e*/) override {
    return false;
  }

 private:
  bool number(double value) {
    if (depth_ == 1 && key_ == "attempt") head_.attempt = static_cast<int>(value);
    if (depth_ == 2 && group_ == "cost" && key_ == "wall_s") head_.wall_s = value;
    if (depth_ == 2 && group_ == "cost" && key_ == "cpu_s") head_.cpu_s = value;
    return true;
  }

  ResultHead& head_;
  int depth_ = 0;
  std::string group_;
  std::string key_;
  bool complete_ = false;
};

template <class Read>
auto read_as(const fs::path& path, const Read& read) {
  try {
    return read();
  } catch (const nlohmann::json::exception& e) {
    throw ConfigError(path.string(), 0, std::string("is no file of a fleet run: ") + e.what());
  } catch (const ConfigError&) {
    throw;
  } catch (const std::runtime_error& e) {
    throw ConfigError(path.string(), 0, e.what());
  }
}

}  // namespace

bool RunFolder::exists() const { return fs::exists(path_ / "fleet.json"); }

void RunFolder::create(const FleetPlan& plan, const std::vector<FleetTask>& tasks) const {
  if (exists()) {
    throw std::runtime_error(
        fmt::format("{}: is there already; --overwrite replaces it, `roadfix fleet resume {}` goes on with it",
                    path_.string(), path_.string()));
  }
  std::string lines;
  for (const FleetTask& task : tasks) lines += json_of(task).dump() + "\n";
  write_text_file(path_ / "tasks.jsonl", lines);
  write_plan(plan);
}

void RunFolder::write_plan(const FleetPlan& plan) const {
  write_text_file(path_ / "fleet.json", json_of(plan).dump(2) + "\n");
}

FleetPlan RunFolder::plan() const {
  const fs::path path = path_ / "fleet.json";
  if (!fs::exists(path)) throw ConfigError(path_.string(), 0, "is no fleet run: it has no fleet.json");
  return read_as(path, [&] { return plan_of(Json::parse(read_text_file(path))); });
}

std::vector<FleetTask> RunFolder::tasks() const {
  const fs::path path = path_ / "tasks.jsonl";
  std::ifstream lines(path);
  std::vector<FleetTask> tasks;
  read_as(path, [&] {
    for (std::string line; std::getline(lines, line);) tasks.push_back(task_of(line));
    if (tasks.size() != plan().tasks) throw std::runtime_error("does not hold the tasks that fleet.json counts");
  });
  return tasks;
}

FleetTask RunFolder::task(std::size_t index) const {
  const fs::path path = path_ / "tasks.jsonl";
  std::ifstream lines(path);
  std::string line;
  for (std::size_t i = 0; i <= index; ++i) {
    if (!std::getline(lines, line)) throw ConfigError(path.string(), 0, fmt::format("has no task {}", index));
  }
  return read_as(path, [&] { return task_of(line); });
}

fs::path RunFolder::task_folder(std::size_t index) const { return path_ / "tasks" / fmt::format("{:06}", index); }

std::optional<ResultHead> RunFolder::head(std::size_t index) const {
  std::ifstream stream(result_path(index));
  if (!stream) return std::nullopt;
  ResultHead head;
  HeadReader reader(head);
  Json::sax_parse(stream, &reader, Json::input_format_t::json, false);
  return reader.complete() ? std::optional(head) : std::nullopt;
}

Json RunFolder::result(std::size_t index) const {
  const fs::path path = result_path(index);
  return read_as(path, [&] { return Json::parse(read_text_file(path, std::size_t{1} << 28U)); });
}

void RunFolder::write_result(std::size_t index, const Json& result) const {
  write_text_file(result_path(index), result.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n");
}

fs::path root_here(const FleetPlan& plan) {
  const char* here = std::getenv("ROADFIX_FLEET_ROOT");
  return here != nullptr && *here != '\0' ? fs::path(here) : plan.root;
}

std::string request_digest(const FleetPlan& plan, const FleetTask& task) {
  const Json asked = {plan.stages, plan.channels, plan.alignments, plan.fit_delay, plan.keep, task.words};
  return text_digest(asked.dump());
}

}  // namespace roadfix
