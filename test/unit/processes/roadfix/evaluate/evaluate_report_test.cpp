#include <catch2/catch.hpp>
#include <fstream>
#include <random>

#include "bus/log/log_reader.h"
#include "roadfix/evaluate/evaluation_log.h"
#include "roadfix/evaluate/report.h"
#include "roadfix/protection_level_t.hpp"
#include "support/temporary_folder.h"
#include "unit/processes/roadfix/evaluate/small_log.h"

namespace roadfix {
namespace {

using test::SmallLog;
using test::TemporaryFolder;

void keep(double, pose_t&) {}

EvaluationReport evaluate_all(const std::filesystem::path& path, const EvaluationOptions& options = {}) {
  EvaluationLog log = read_evaluation_log(path, {});
  EvaluationReport report{log.facts, reference_of(log, path), {}, log.fusion, log.notes};
  for (auto& [channel, stream] : log.poses) {
    if (channel == "REFERENCE") continue;
    EstimateInput input;
    input.channel = channel;
    input.local_frame = stream.local_frame;
    input.trajectory = stream.trajectory;
    input.protection = log.protection[channel];
    report.channels.push_back(evaluate_channel(report.reference, report.facts, input, options));
  }
  return report;
}

TEST_CASE("a log is read back to the figures that were put in") {
  const TemporaryFolder folder;
  const SmallLog small;
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    small.write_estimate(writer, "POSE_INS", [](double, pose_t& m) { m.position_m[2] += 0.25; });
    small.write_estimate(writer, "POSE_LOCAL", [](double, pose_t& m) { m.frame = pose_t::FRAME_LOCAL; });
    writer.commit();
  }
  const EvaluationReport report = evaluate_all(folder / "out.lcm");
  REQUIRE(report.channels.size() == 2);
  const auto json = report_json(report);
  const auto& ins = json["channels"]["POSE_INS"];
  CHECK(ins["errors"]["vertical_m"]["rmse"].get<double>() == Approx(0.25));
  CHECK(ins["errors"]["horizontal_m"]["max"].get<double>() < 1e-6);
  CHECK(ins["outages"]["count"] == 2);
  CHECK(ins["outages"]["vertical_m"]["max"].get<double>() == Approx(0.25));
  CHECK(ins["scored"] == 2301);
  CHECK(json["channels"]["POSE_LOCAL"]["alignment"] == "yaw");
  CHECK(json["drive"]["name"] == "small <drive>");
  const std::string table = report_table(report);
  CHECK(table.find("POSE_INS") != std::string::npos);
  CHECK(table.find("0.2500") != std::string::npos);
  // Lee et al.'s (2025) tables: as published, and aligned by a similarity as the paper did it, named apart.
  const std::size_t paper = table.find("Lee 2025      ");
  REQUIRE(paper != std::string::npos);
  CHECK(table.find("ATE sim3 m", paper) != std::string::npos);
  CHECK(table.find("always CA %", paper) != std::string::npos);
  const std::string page = report_page(report);
  for (const char* key : {"@TITLE@", "@CSS@", "@TABLE@", "@JS@", "@PLOTS@", "@FIGURES@"}) {
    CHECK(page.find(key) == std::string::npos);
  }
  CHECK(page.find("<h1>small &lt;drive></h1>") != std::string::npos);
  CHECK(page.find("http://") == page.find("http://www.w3.org/2000/svg"));  // nothing to fetch
  CHECK(page.find("https://") == std::string::npos);
}

TEST_CASE("what is left without slow errors is said beside the figures as published, by its window") {
  const TemporaryFolder folder;
  const SmallLog small;
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    small.write_estimate(writer, "POSE_INS", [](double, pose_t& m) { m.position_m[2] += 0.25; });
    writer.commit();
  }
  EvaluationOptions options;
  options.slow_window = 20.0;
  const EvaluationReport report = evaluate_all((folder / "out.lcm"), options);
  const auto json = report_json(report);
  const auto& ins = json["channels"]["POSE_INS"];
  CHECK(ins["slow_removed"]["window_s"] == 20.0);
  CHECK(ins["slow_removed"]["ate_rmse_m"].get<double>() < 0.01);
  CHECK(ins["ate_rmse_m"].get<double>() == Approx(0.25));
  CHECK(report_table(report).find("without errors slower than 20 s") != std::string::npos);
  CHECK(!report_json(evaluate_all(folder / "out.lcm"))["channels"]["POSE_INS"].contains("slow_removed"));
}

/// The page's data: what stands between `begin` and the next end of a script element.
nlohmann::json page_data(const std::string& page, const std::string& id) {
  const std::string begin = "id=\"" + id + "\">";
  const std::size_t at = page.find(begin);
  REQUIRE(at != std::string::npos);
  const std::size_t from = at + begin.size();
  return nlohmann::json::parse(page.substr(from, page.find("</script>", from) - from));
}

TEST_CASE("the page has errors beside their protection levels over time, and Stanford diagrams of each axis") {
  const TemporaryFolder folder;
  const SmallLog small;
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    small.write_estimate(writer, "POSE_INS", [&](double t_s, pose_t& m) {
      m.position_m[2] += t_s > 100.0 && t_s < 101.0 ? 3.0 : 0.25;
      protection_level_t level{};
      level.utime = level.pose_utime = m.utime;
      level.num_risks = 2;
      level.risk = {1e-3, 1e-5};
      level.along_m = {0.5, 0.9};
      level.across_m = {0.2, 0.3};
      level.up_m = {1.0, t_s < 50.0 ? INFINITY : 2.0};
      level.alert_along_m = 1.4;
      level.alert_across_m = 0.57;
      level.alert_up_m = 1.3;
      writer.write("PROTECTION_INS", m.utime, encode(level));
    });
    writer.commit();
  }
  const EvaluationReport report = evaluate_all(folder / "out.lcm");
  const std::string page = report_page(report);
  const nlohmann::json plots = page_data(page, "plots");
  const nlohmann::json &channel = plots["channels"][0], &levels = channel["levels"];
  CHECK(levels["risks"] == nlohmann::json{1e-3, 1e-5});
  CHECK(levels["alert_limit_m"] == nlohmann::json{1.4, 0.57, 1.3});
  const nlohmann::json &up = levels["axes"][2], &error = up["error_m"];
  CHECK(up["level_m"][1].front().is_null());  // infinite
  CHECK(up["level_m"][1].back() == 2.0);
  CHECK(levels["axes"][1]["level_m"][0].back() == 0.2);
  CHECK(error.back() == 0.25);
  CHECK(std::count(error.begin(), error.end(), 3.0) > 0);  // a second of it survives the thinning
  CHECK(error.size() <= 2500);
  const nlohmann::json risk = page_data(page, "figures")["channels"]["POSE_INS"]["protection"]["risks"][0];
  CHECK(risk["stanford"].size() == 3);
  CHECK(risk["misleading_by_axis"][2] > 0);
  CHECK(plots["bins"]["per_decade"] == 8);
}

TEST_CASE("an estimate without covariance is said to have none") {
  const TemporaryFolder folder;
  const SmallLog small;
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    small.write_estimate(writer, "POSE_VO", [](double, pose_t& m) {
      for (auto& row : m.cov_pose_m2_rad2) std::fill(row, row + 6, 0.0);
    });
    writer.commit();
  }
  const EvaluationReport report = evaluate_all(folder / "out.lcm");
  CHECK(report.channels[0].consistency.position.unusable == report.channels[0].pairs);
  CHECK(report_table(report).find("covariance: none") != std::string::npos);
}

TEST_CASE("an estimate in another ENU frame lands on the reference") {
  const TemporaryFolder folder;
  const SmallLog small;
  SmallLog far = small;
  far.anchor = {small.anchor.latitude + 2e-4, small.anchor.longitude - 3e-4, small.anchor.height + 30.0};
  const EnuAnchor here(small.anchor);
  const EnuAnchor there(far.anchor);
  const Eigen::Matrix3d R = there.R_ecef_enu().transpose() * here.R_ecef_enu();
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    far.write_estimate(writer, "POSE_INS", [&](double t_s, pose_t& m) {
      const SE3 T = test::eight(t_s).T_frame_vehicle;
      const Eigen::Vector3d p = there.enu(here.geodetic(T.p));
      const Eigen::Quaterniond q(Eigen::Matrix3d(R * T.R()));
      std::copy(p.data(), p.data() + 3, m.position_m);
      const double wxyz[] = {q.w(), q.x(), q.y(), q.z()};
      std::copy(wxyz, wxyz + 4, m.q_wxyz);
    });
    writer.commit();
  }
  EvaluationLog log = read_evaluation_log(folder / "out.lcm", {});
  PoseStream& stream = log.poses.at("POSE_INS");
  CHECK(stream.trajectory.poses[0].T_frame_vehicle.p.norm() > 1000.0);
  move_to_anchor(stream, *log.poses.at("REFERENCE").anchor);
  for (const PosePair& pair : associate(stream.trajectory, log.poses.at("REFERENCE").trajectory, true)) {
    REQUIRE(local(pair.estimate.T_frame_vehicle, pair.reference.T_frame_vehicle).norm() < 1e-6);
  }
}

TEST_CASE("poses that are invalid before there is an anchor give the channel none") {
  const SmallLog small;
  const auto read_with_start = [&](int8_t validity) {
    const TemporaryFolder folder;
    {
      LogWriter writer(folder / "out.lcm");
      small.write_estimate(writer, "POSE_INS", [&](double t_s, pose_t& m) {
        if (t_s > 7.0) return;  // as long as the filter waits for a fix
        m.anchor_lat_deg = m.anchor_lon_deg = m.anchor_height_m = 0.0;
        m.validity = validity;
      });
      writer.commit();
    }
    return read_evaluation_log(folder / "out.lcm", {"POSE_INS"}).poses.at("POSE_INS");
  };
  const PoseStream stream = read_with_start(pose_t::VALIDITY_INVALID);
  CHECK(stream.anchor->latitude == Approx(small.anchor.latitude).epsilon(1e-12));
  const Odometry& last = stream.trajectory.poses.back();
  CHECK(last.T_frame_vehicle.p.norm() < 1000.0);
  CHECK(local(last.T_frame_vehicle, test::eight(small.end_s).T_frame_vehicle).norm() < 1e-6);
  CHECK(stream.trajectory.poses.size() == 5001);
  // A pose that is one belongs where it says, and all others with it.
  const PoseStream elsewhere = read_with_start(pose_t::VALIDITY_VALID);
  CHECK(elsewhere.anchor->latitude == 0.0);
  CHECK(elsewhere.trajectory.poses.back().T_frame_vehicle.p.norm() > 1e6);
}

TEST_CASE("lever arms come from the calibration, and a missing one is said") {
  const TemporaryFolder folder;
  {
    LogWriter writer(folder / "out.lcm");
    SmallLog().write_drive(writer);
    writer.commit();
  }
  const EvaluationLog log = read_evaluation_log(folder / "out.lcm", {});
  std::vector<std::string> notes;
  CHECK(lever_arm_between(pose_t::ORIGIN_IMU, pose_t::ORIGIN_ANTENNA, log.calibration, notes) ==
        Eigen::Vector3d(1.0, 0.5, 1.5));
  CHECK(notes.empty());
  CHECK(lever_arm_between(pose_t::ORIGIN_IMU, pose_t::ORIGIN_REAR_AXLE, log.calibration, notes).isZero());
  CHECK(notes.size() == 1);
}

TEST_CASE("a repeated stretch, a change of frame and bytes that are no message are left out and said") {
  const TemporaryFolder folder;
  const SmallLog small;
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    small.write_estimate(writer, "POSE_VO", [](double t_s, pose_t& m) {
      if (t_s < 10.0) m.frame = pose_t::FRAME_LOCAL;
    });
    small.write_estimate(writer, "POSE_VO", keep);
    const std::vector<uint8_t> junk(200, 7);
    writer.write("POSE_VO", test::kStart_us, junk);
    writer.commit();
  }
  const EvaluationLog log = read_evaluation_log(folder / "out.lcm", {});
  const PoseStream& stream = log.poses.at("POSE_VO");
  CHECK(stream.backward == 5001);
  CHECK(stream.other_frame == 200);
  CHECK(left_out("POSE_VO", stream) ==
        "POSE_VO: 5001 poses for a time that has one already and 200 in another frame are left out");
  CHECK(left_out("REFERENCE", log.poses.at("REFERENCE")).empty());
  CHECK(stream.trajectory.poses.size() == 5001 - 200);
  CHECK(stream.reasons.size() == stream.trajectory.poses.size());
  REQUIRE(log.notes.size() == 1);
  CHECK(log.notes[0].find("1 messages") != std::string::npos);
}

TEST_CASE("the order of the events in a log changes no figure, and a stray stamp only its own message") {
  const TemporaryFolder folder;
  const SmallLog small;
  {
    LogWriter writer(folder / "in.lcm");
    small.write_drive(writer);
    int64_t seq = 0;
    small.write_estimate(writer, "POSE_INS", [&](double t_s, pose_t& m) {
      m.position_m[2] += 0.1 * std::sin(t_s);
      m.seq = seq++;
    });
    writer.commit();
  }
  struct Event {
    std::string channel;
    std::vector<uint8_t> bytes;
  };
  std::vector<Event> events;
  LogReader reader(folder / "in.lcm");
  while (const auto event = reader.next())
    events.push_back({std::string(event->channel), {event->data.begin(), event->data.end()}});
  const auto figures = [&](const std::string& name) {
    {
      LogWriter writer((folder / name));
      for (const Event& event : events) writer.write(event.channel, read_header(event.bytes)->utime, event.bytes);
      writer.commit();
    }
    return report_json(evaluate_all((folder / name)));
  };
  const auto in_order = figures("a.lcm");
  std::mt19937 random(5);
  std::shuffle(events.begin(), events.end(), random);
  CHECK(figures("b.lcm") == in_order);
  for (Event& event : events) {
    if (event.channel != "POSE_INS") continue;
    pose_t m = decode<pose_t>(event.bytes);
    if (m.seq != 2000) continue;
    m.utime += 365LL * 86'400'000'000;
    event.bytes = encode(m);
  }
  const auto stray = figures("c.lcm");
  CHECK(stray["channels"]["POSE_INS"]["poses"] == 5000);
  CHECK(stray["channels"]["POSE_INS"]["availability"] == in_order["channels"]["POSE_INS"]["availability"]);
  CHECK(stray["channels"]["POSE_INS"]["scored"].get<int>() + 1 >=
        in_order["channels"]["POSE_INS"]["scored"].get<int>());
  CHECK(stray["notes"].size() == 1);
}

TEST_CASE("a name that is no text is shown as far as it is one") {
  const TemporaryFolder folder;
  SmallLog small;
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    writer.commit();
  }
  EvaluationReport report = evaluate_all(folder / "out.lcm");
  report.facts.name = "drive \xB8";
  report.notes = {"note \xFF"};
  CHECK_THAT(report_page(report), Catch::Contains("drive "));
}

TEST_CASE("modes and weights come from the fusion's state by name") {
  const TemporaryFolder folder;
  fusion_state2_t state{};
  state.num_modes = 2;
  state.mode_name = {"constant_acceleration", "constant_turn"};
  state.mode_probability = {0.25, 0.75};
  state.mode_log_likelihood = {0.0, 0.0};
  const auto set_channels = [&](const std::vector<std::string>& names, const std::vector<double>& weights) {
    state.num_channels = static_cast<int>(names.size());
    state.channel_name = names;
    state.channel_weight = weights;
    state.channel_status.assign(names.size(), 0);
    state.channel_health.assign(names.size(), fusion_state2_t::HEALTH_GOOD);
    state.channel_contradicts.assign(names.size(), "");
    for (auto* values : {&state.channel_alpha, &state.channel_yaw_alpha, &state.channel_nis, &state.channel_gate,
                         &state.channel_age_s, &state.channel_scale, &state.channel_scale_std}) {
      values->assign(names.size(), 0.0);
    }
  };
  {
    LogWriter writer(folder / "out.lcm");
    set_channels({"POSE_INS"}, {1.0});
    writer.write("FUSION_STATE", 1, encode(state));
    set_channels({"POSE_INS", "POSE_VO"}, {0.4, 0.6});
    state.utime = 5;
    writer.write("FUSION_STATE", 5, encode(state));
    writer.commit();
  }
  const FusionSeries fusion = read_evaluation_log(folder / "out.lcm", {}).fusion;
  REQUIRE(fusion.modes.size() == 2);
  CHECK(fusion.modes[1].turn_probability == 0.75);
  CHECK(fusion.modes[1].t_us == 5);
  CHECK(fusion.weights.at("POSE_VO") == std::vector<double>{0.0, 0.6});
  CHECK(fusion.weights.at("POSE_INS") == std::vector<double>{1.0, 0.4});
}

TEST_CASE("a log without a reference is an error that names the file") {
  const TemporaryFolder folder;
  {
    LogWriter writer(folder / "out.lcm");
    SmallLog().write_estimate(writer, "POSE_INS", keep);
    writer.commit();
  }
  const EvaluationLog log = read_evaluation_log(folder / "out.lcm", {});
  CHECK_THROWS_WITH(reference_of(log, (folder / "out.lcm")),
                    Catch::Contains("out.lcm") && Catch::Contains("REFERENCE"));
}

TEST_CASE("withheld and unscorable references are told by reason and validity") {
  const TemporaryFolder folder;
  SmallLog small;
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    writer.commit();
  }
  {
    LogWriter writer(folder / "flagged.lcm");
    for (int i = 0; i < 10; ++i) {
      pose_t m = test::pose_message(test::eight(0.1 * i), small.anchor);
      if (i % 2 == 0) m.reason = kWithheld;
      if (i == 3) m.validity = pose_t::VALIDITY_INVALID;
      writer.write("REFERENCE", m.utime, encode(m));
    }
    writer.commit();
  }
  const Reference reference = reference_of(read_evaluation_log(folder / "flagged.lcm", {}), "flagged.lcm");
  CHECK(reference.flags[2].withheld);
  CHECK_FALSE(reference.flags[1].withheld);
  CHECK_FALSE(reference.flags[3].may_score);
  CHECK(reference.flags[4].may_score);
}

}  // namespace
}  // namespace roadfix
