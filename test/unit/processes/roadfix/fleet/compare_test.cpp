#include "roadfix/fleet/compare.h"

#include <catch2/catch.hpp>
#include <random>

#include "support/temporary_folder.h"

using namespace roadfix;
using Catch::Matchers::Contains;
using Json = nlohmann::ordered_json;

namespace {

/// Figures of one channel as a task writes them.
struct Drive {
  double rmse = 0.0;
  double nees = 0.9;
  double silent = 0.01;
  bool ok = true;
};

Json result_of(const Drive& drive) {
  const Json channel = {{"scored", 100},
                        {"errors", {{"horizontal_m", {{"rmse", drive.rmse}, {"p95", 2.0 * drive.rmse}}}}},
                        {"outages", {{"count", 0}}},
                        {"honesty", {{"position_m", {{"samples", 100}, {"nees_per_dof", drive.nees}}}}},
                        {"availability", {{"invalid", 0.0}, {"silent", drive.silent}}}};
  return {
      {"status", drive.ok ? "ok" : "failed"},
      {"reason", drive.ok ? "" : "killed by signal 9"},
      {"key", Json::object()},
      {"figures", {{"digests", {{"POSE_INS", std::to_string(drive.rmse)}}}, {"channels", {{"POSE_INS", channel}}}}}};
}

class Runs {
 public:
  RunFolder make(const std::string& name, const std::vector<Drive>& drives) const {
    RunFolder run(folder_ / name);
    FleetPlan plan;
    plan.configs = {{"", ""}};
    plan.tasks = drives.size();
    std::vector<FleetTask> tasks;
    for (std::size_t i = 0; i < drives.size(); ++i) tasks.push_back({i, "drive " + std::to_string(i), {}, 0});
    run.create(plan, tasks);
    for (std::size_t i = 0; i < drives.size(); ++i) run.write_result(i, result_of(drives[i]));
    return run;
  }

 private:
  test::TemporaryFolder folder_;
};

std::vector<Drive> two_hundred() {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  std::vector<Drive> drives(200);
  for (Drive& drive : drives) drive.rmse = 0.1 * std::exp(normal(random));
  return drives;
}

}  // namespace

TEST_CASE("compare: one drive of 200 that got worse is found and named first") {
  const Runs runs;
  std::vector<Drive> drives = two_hundred();
  const RunFolder a = runs.make("a", drives);
  drives[137].rmse *= 1.2;
  const Comparison comparison = compare_runs(a, runs.make("b", drives), {});
  CHECK(comparison.regressed());
  CHECK(comparison.same_digests == 199);
  const std::string text = comparison_text(comparison, {});
  CHECK_THAT(text, Contains("the worst drives:\n") && Contains("drive 137\n"));
  CHECK_THAT(text, Contains("REGRESSION: 1 drives worse by more than 5 %, 0 figures worse on the whole, 0 lost"));
  CompareOptions generous;
  generous.tolerance = 0.3;
  CHECK_FALSE(compare_runs(a, RunFolder(a.path().parent_path() / "b"), generous).regressed());
}

TEST_CASE("compare: the same figures are no regression, whatever the tolerance") {
  const Runs runs;
  const RunFolder a = runs.make("a", two_hundred());
  CompareOptions strict;
  strict.tolerance = strict.mean_tolerance = 0.0;
  const Comparison comparison = compare_runs(a, runs.make("b", two_hundred()), strict);
  CHECK_FALSE(comparison.regressed());
  CHECK(comparison.same_digests == 200);
  CHECK_THAT(comparison_text(comparison, strict), Contains("no regression") && !Contains("worst drives"));
}

TEST_CASE("compare: a little worse everywhere is found by the mean, better nowhere") {
  const Runs runs;
  std::vector<Drive> drives = two_hundred();
  const RunFolder a = runs.make("a", drives);
  for (Drive& drive : drives) drive.rmse *= 1.03;
  CHECK(compare_runs(a, runs.make("worse", drives), {}).regressed());
  for (Drive& drive : drives) drive.rmse /= 1.06;
  CHECK_FALSE(compare_runs(a, runs.make("better", drives), {}).regressed());
}

TEST_CASE("compare: drives that are lost, overconfident or silent are regressions") {
  const Runs runs;
  std::vector<Drive> drives = two_hundred();
  const RunFolder a = runs.make("a", drives);
  const auto with = [&](const std::string& name, const Drive& changed) {
    std::vector<Drive> other = drives;
    other[5] = changed;
    return compare_runs(a, runs.make(name, other), {});
  };
  const Comparison lost = with("lost", {drives[5].rmse, 0.9, 0.01, false});
  CHECK(lost.regressed());
  CHECK_THAT(comparison_text(lost, {}), Contains("lost: drive 5: killed by signal 9"));
  CHECK(with("overconfident", {drives[5].rmse, 1.2, 0.01, true}).regressed());
  CHECK(with("silent", {drives[5].rmse, 0.9, 0.05, true}).regressed());
  CHECK_FALSE(with("shy", {drives[5].rmse, 0.2, 0.01, true}).regressed());
}

TEST_CASE("compare: runs without a common drive are an error, further drives are counted") {
  const Runs runs;
  std::vector<Drive> drives = two_hundred();
  const RunFolder a = runs.make("a", drives);
  drives.resize(150);
  CHECK(compare_runs(a, runs.make("fewer", drives), {}).only_a == 50);
  CHECK_THROWS_WITH(compare_runs(a, runs.make("none", {}), {}), Contains("no drive has ended well in both"));
}
