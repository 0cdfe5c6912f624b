#include "roadfix/paper/paper_c.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "config/calibration.h"
#include "geometry/frames.h"
#include "paper_log.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "roadfix/stages.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

using test::PaperLog;
using test::TemporaryFolder;

PaperRequest request_for(const std::filesystem::path& log) {
  PaperRequest request;
  request.drive = log;
  request.vehicle = test::source_path("configs/demo");
  request.turn_threshold = 3.0 * kDegree;
  return request;
}

PaperReport tables_of(const PaperLog& log, const TemporaryFolder& folder) {
  log.write(folder / "drive.lcm");
  return paper_c(request_for(folder / "drive.lcm"));
}

double value(const PaperTable& table, const std::string& row, std::size_t column) {
  for (const PaperTable::Row& r : table.rows) {
    if (r.name != row) continue;
    REQUIRE(r.values.at(column).has_value());
    return *r.values[column];
  }
  FAIL("no row " << row);
  return 0.0;
}

TEST_CASE("the printed fusion is what imm_fusion does with its scheme, and each part left out is another row") {
  const TemporaryFolder folder;
  const PaperReport report = tables_of({}, folder);
  const PaperTable& accuracy = report.tables.at(0);
  const PaperTable& transitions = report.tables.at(1);
  CHECK(accuracy.rows.size() == 11);
  CHECK(transitions.rows.size() == 9);

  ImmFusionConfig config;
  config.scheme = FusionScheme::kLiteral;
  std::vector<std::unique_ptr<Stage>> stages;
  stages.push_back(make_imm_fusion(Calibration{}, config));
  replay_for_paper(folder / "drive.lcm", folder / "fused.lcm", std::move(stages));
  EvaluationRequest wanted;
  wanted.log = folder / "fused.lcm";
  wanted.channels = {"POSE_FUSED"};
  const ChannelScore score = evaluate_log(wanted).channels.front();
  CHECK(value(accuracy, "fusion, literal", 0) == score.ate_mean);
  CHECK(value(accuracy, "fusion, literal", 1) == *score.rpe_mean);
  CHECK(value(transitions, "literal", 0) == *score.tse_m);

  std::set<double> seen;
  for (const PaperTable::Row& row : accuracy.rows) {
    if (row.name == "fusion, literal, no clip") continue;  // nothing to clip in this drive
    if (row.name == "fusion, default") continue;           // it follows the INS
    INFO(row.name);
    CHECK(seen.insert(row.values.at(0).value()).second);
  }
  // The outage is found from the fixes, and shaded.
  REQUIRE(report.intervals.size() == 1);
  CHECK(report.intervals[0].second == Approx(35.0));
}

TEST_CASE("good vision carries the fusion through the outage, vision that turns by itself does not") {
  const TemporaryFolder folder;
  PaperLog poor;  // poses of one filter count as independent ones, so that a poor INS still has most of the weight
  poor.ins.velocity_walk = 0.3;
  const PaperReport good = tables_of(poor, folder);
  CHECK(value(good.tables[0], "fusion, literal", 0) < 0.95 * value(good.tables[0], "GNSS/INS", 0));
  PaperLog turning = poor;
  turning.vision.fault = [](double t_s, Planar& motion) {
    if (t_s > 16.0) motion.z() += 0.01;
    return true;
  };
  const PaperReport bad = tables_of(turning, folder);
  CHECK(value(bad.tables[0], "fusion, literal", 0) > 1.2 * value(good.tables[0], "fusion, literal", 0));
  CHECK(value(bad.tables[0], "GNSS/INS", 0) == value(good.tables[0], "GNSS/INS", 0));
}

TEST_CASE("configs/paper_c is the demo's vehicle with an EKF without a camera and an MSCKF without a receiver") {
  const std::filesystem::path vehicle = test::source_path("configs/paper_c");
  CHECK(calibration_text(load_calibration(vehicle)) ==
        calibration_text(load_calibration(test::source_path("configs/demo"))));
  const auto stages = make_stages({"gnss_ins_ekf", "vo_tracker"}, vehicle);
  const auto reads = [&](std::size_t stage, const std::string& channel) {
    const auto& inputs = stages.at(stage)->spec().inputs;
    return std::any_of(inputs.begin(), inputs.end(), [&](const InputSpec& i) { return i.channel == channel; });
  };
  CHECK(reads(0, "GNSS"));
  CHECK(!reads(0, "VO_FEATURES"));
  CHECK(reads(1, "CAMERA_LEFT"));
  CHECK(reads(1, "IMU"));
  CHECK(!reads(1, "GNSS"));
  CHECK(!reads(1, "POSE_INS"));
}

TEST_CASE("a drive that lacks a channel is refused with its name") {
  const TemporaryFolder folder;
  const auto refusal = [&](PaperLog log) -> std::string {
    try {
      static_cast<void>(tables_of(log, folder));
    } catch (const PaperError& e) {
      return e.what();
    }
    return "";
  };
  CHECK(refusal({}).empty());
  PaperLog log;
  log.with_reference = false;
  CHECK(refusal(log).find("drive.lcm: no messages on channel REFERENCE") != std::string::npos);
  log = {};
  log.with_vision = false;
  CHECK(refusal(log).find("no messages on channel IMU, which POSE_INS is made from") != std::string::npos);
  CHECK(refusal(log).find("POSE_WHEEL") != std::string::npos);
}

}  // namespace
}  // namespace roadfix
