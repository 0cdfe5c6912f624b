#include "roadfix/fleet/run_folder.h"

#include <catch2/catch.hpp>
#include <fstream>

#include "roadfix/fleet/input_digest.h"
#include "roadfix/fleet/progress.h"
#include "support/temporary_folder.h"

using namespace roadfix;
using Catch::Matchers::Contains;
using Json = nlohmann::ordered_json;

namespace {

FleetPlan small_plan() {
  FleetPlan plan;
  plan.build = std::string("b");
  plan.stages = {"gnss_ins_ekf"};
  plan.configs = {{"", ""}};
  plan.alignments = {{"POSE_WHEEL", "tied"}};
  plan.tasks = 2;
  return plan;
}

std::vector<FleetTask> small_tasks() {
  return {{0, "city_loop seed=1", {"city_loop", "seed=1"}, 0}, {1, "city_loop seed=2", {"city_loop", "seed=2"}, 0}};
}

Json result(const std::string& status, const TaskKey& key) {
  return {{"index", 0},
          {"attempt", 3},
          {"status", status},
          {"reason", status == "ok" ? "" : "it broke"},
          {"key", {{"input", key.input}, {"config", key.config}, {"build", key.build}, {"request", key.request}}},
          {"input_stamp", "s"},
          {"cost", {{"wall_s", 2.5}, {"cpu_s", 2}}},
          {"figures", {{"status", "trap"}, {"channels", Json::array({1, 2})}}}};
}

}  // namespace

TEST_CASE("fleet: a plan and its tasks come back as they were written") {
  const test::TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.create(small_plan(), small_tasks());
  CHECK(run.plan().stages == small_plan().stages);
  CHECK(run.plan().alignments == small_plan().alignments);
  CHECK(run.tasks().size() == 2);
  CHECK(run.task(1).words == small_tasks()[1].words);
  CHECK_THROWS_WITH(run.task(2), Contains("has no task 2"));
  CHECK_THROWS_WITH(run.create(small_plan(), small_tasks()), Contains("is there already; --overwrite"));
  CHECK_THROWS_WITH(RunFolder(folder / "other").plan(), Contains("is no fleet run"));
}

TEST_CASE("fleet: a broken plan is named with what is wrong") {
  const test::TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.create(small_plan(), small_tasks());
  std::ofstream(run.path() / "fleet.json") << "{\"format\": 99}";
  CHECK_THROWS_WITH(run.plan(), Contains("fleet.json: format is not 1"));
  std::ofstream(run.path() / "fleet.json") << "{\"format\":";
  CHECK_THROWS_WITH(run.plan(), Contains("fleet.json: is no file of a fleet run"));
}

TEST_CASE("fleet: the head of a result is read without its figures") {
  const test::TemporaryFolder folder;
  const RunFolder run(folder / "run");
  const TaskKey key{"i", "c", "b", "r"};
  CHECK_FALSE(run.head(0));
  run.write_result(0, result("ok", key));
  const auto head = run.head(0);
  REQUIRE(head);
  CHECK(head->ok);
  CHECK(head->key == key);
  CHECK(head->input_stamp == "s");
  CHECK(head->wall_s == 2.5);
  CHECK(head->cpu_s == 2.0);
  CHECK(head->attempt == 3);
  run.write_result(0, result("failed", key));
  CHECK_FALSE(run.head(0)->ok);
  CHECK(run.head(0)->reason == "it broke");
}

TEST_CASE("fleet: a result cut short before its figures is none") {
  const test::TemporaryFolder folder;
  const RunFolder run(folder / "run");
  const std::string text = result("ok", {"i", "c", "b", "r"}).dump();
  std::filesystem::create_directories(run.task_folder(0));
  for (std::size_t length = 0; length < text.find("\"figures\""); length += 7) {
    std::ofstream(run.result_path(0)) << text.substr(0, length);
    CHECK_FALSE(run.head(0));
  }
}

TEST_CASE("fleet: the request's digest knows stages, scores and the drive's own changes, not limits") {
  const FleetTask task = small_tasks()[0];
  FleetPlan plan = small_plan();
  const std::string digest = request_digest(plan, task);
  plan.time_limit_s = 5.0;
  plan.root = "/elsewhere";
  CHECK(request_digest(plan, task) == digest);
  CHECK(request_digest(plan, small_tasks()[1]) != digest);
  plan.alignments.clear();
  CHECK(request_digest(plan, task) != digest);
}

TEST_CASE("fleet: digests know bytes and names, stamps a touch") {
  const test::TemporaryFolder folder;
  const auto write = [&](const std::string& name, const std::string& text) { std::ofstream(folder / name) << text; };
  std::filesystem::create_directories(folder / "v");
  write("v/a.yaml", "one");
  const std::string digest = path_digest(folder / "v");
  const std::string stamp = path_stamp(folder / "v");
  CHECK(path_digest(folder / "v/a.yaml") == text_digest("one"));
  std::filesystem::last_write_time(folder / "v/a.yaml", std::filesystem::file_time_type::clock::now());
  CHECK(path_digest(folder / "v") == digest);
  CHECK(path_stamp(folder / "v") != stamp);
  write("v/a.yaml", "two");
  CHECK(path_digest(folder / "v") != digest);
  std::filesystem::rename(folder / "v/a.yaml", folder / "v/b.yaml");
  write("v/b.yaml", "one");
  CHECK(path_digest(folder / "v") != digest);
  CHECK_THROWS(path_stamp(folder / "nowhere"));
}

TEST_CASE("fleet: progress counts results that are new, and those alone") {
  const test::TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.write_result(0, result("failed", {}));
  FleetProgress progress(run, {0, 1});
  CHECK_FALSE(progress.look());
  run.write_result(1, result("ok", {}));
  CHECK(progress.look());
  CHECK(progress.done() == 1);
  CHECK_THAT(progress.line(), Contains("1 of 2 done") && Contains("left"));
  std::filesystem::last_write_time(run.result_path(0), std::filesystem::file_time_type::clock::now());
  CHECK(progress.look());
  CHECK(progress.failed() == 1);
}

TEST_CASE("fleet: what is left is told from the pace of the results, while somebody is at work") {
  const test::TemporaryFolder folder;
  const RunFolder run(folder / "run");
  std::vector<TaskStatus> tasks(5);
  const auto now = std::filesystem::file_time_type::clock::now();
  for (std::size_t i = 0; i < 3; ++i) {
    tasks[i].task.index = i;
    tasks[i].state = i == 1 ? TaskState::kFailed : TaskState::kOk;
    run.write_result(i, result("ok", {}));
    std::filesystem::last_write_time(run.result_path(i), now - std::chrono::seconds(10 * i));
  }
  CHECK_FALSE(time_left(run, tasks));
  tasks[4].at_work = true;
  CHECK(time_left(run, tasks).value() == Approx(20.0));
}

TEST_CASE("fleet: durations are said as people say them") {
  CHECK(duration_text(45.2) == "45 s");
  CHECK(duration_text(725) == "12 min");
  CHECK(duration_text(11100) == "3 h 05 min");
}
