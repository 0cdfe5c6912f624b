#include "monitor/screen.h"

#include <catch2/catch.hpp>
#include <limits>

#include "monitor/messages.h"

using namespace roadfix;

namespace {

HealthReport some_report(Verdict verdict) {
  HealthReport report;
  report.now_us = 1'700'000'000'000'000;
  report.since_us = report.now_us - 65'000'000;
  report.verdict = verdict;
  report.judged_pose = "POSE_FUSED";
  PoseReport pose;
  pose.name = "POSE_FUSED";
  pose.validity = Validity::kValid;
  pose.position_std = 0.123;
  report.poses = {pose};
  for (int i = 0; i < 9; ++i) {
    report.reasons.push_back({"k" + std::to_string(i), verdict, 0, "reason number " + std::to_string(i)});
  }
  ChannelReport channel;
  channel.name = "GNSS";
  channel.rate_hz = 4.0;
  channel.expected_hz = 4.0;
  report.channels = {channel};
  return report;
}

std::vector<std::string> lines_of(const std::string& page) {
  std::vector<std::string> lines{""};
  for (const char c : page) {
    if (c == '\n')
      lines.emplace_back();
    else
      lines.back() += c;
  }
  return lines;
}

std::size_t columns(const std::string& line) {
  return static_cast<std::size_t>(
      std::count_if(line.begin(), line.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

}  // namespace

TEST_CASE("the page fits every terminal") {
  for (const ScreenSize size : {ScreenSize{80, 24}, {200, 60}, {40, 12}, {10, 3}, {1, 1}}) {
    for (const Verdict verdict : {Verdict::kOk, Verdict::kDegraded, Verdict::kDoNotUse}) {
      const std::vector<std::string> lines = lines_of(render_screen(some_report(verdict), size, false));
      CAPTURE(size.columns, size.rows);
      CHECK(static_cast<int>(lines.size()) == size.rows);
      for (const std::string& line : lines) CHECK(static_cast<int>(columns(line)) <= size.columns);
    }
  }
}

TEST_CASE("verdict in big letters where there is room, in words where there is none, reasons, figures") {
  const std::string wide = render_screen(some_report(Verdict::kDoNotUse), {80, 40}, false);
  CHECK_THAT(wide, Catch::Contains("█▄▄▄▀"));
  CHECK_THAT(wide, Catch::Contains("reason number 5"));
  CHECK_THAT(wide, Catch::Contains("and 3 more"));
  CHECK_THAT(wide, Catch::Contains("POSE_FUSED valid, sure to 0.12 m"));
  CHECK_THAT(wide, Catch::Contains("GNSS"));
  const std::string narrow = render_screen(some_report(Verdict::kDoNotUse), {40, 24}, false);
  CHECK_THAT(narrow, Catch::Contains("DO NOT USE"));
  CHECK_THAT(narrow, !Catch::Contains("█"));
  CHECK_THAT(narrow, Catch::Contains("km/h; this verdict for"));  // in a line of its own
}

TEST_CASE("the screen shows the protection levels of the judged pose, and why it is not usable") {
  HealthReport report = some_report(Verdict::kOk);
  CHECK_THAT(render_screen(report, {100, 40}, false), !Catch::Contains("along"));
  BoundFacts bound{report.now_us, 1e-5, {0.9, 0.31, 1.2}, true, ""};
  report.poses[0].bound = bound;
  CHECK_THAT(render_screen(report, {100, 40}, false),
             Catch::Contains("within 0.90 m along, 0.31 m across, 1.20 m up (risk 1e-05 per pose): usable"));
  bound.usable = false;
  bound.reason = "positions are not checked yet";
  report.poses[0].bound = bound;
  const std::string refused = render_screen(report, {100, 40}, false);
  CHECK_THAT(refused, Catch::Contains("not usable"));
  CHECK_THAT(refused, Catch::Contains("positions are not checked yet"));
  bound.level.y() = std::numeric_limits<double>::infinity();
  report.poses[0].bound = bound;
  CHECK_THAT(render_screen(report, {100, 40}, false), Catch::Contains("no bound at risk 1e-05 per pose"));
}

TEST_CASE("the screen says which channel carries the fused pose, why, and who contradicts whom") {
  fusion_state2_t m{};
  m.source = fusion_state2_t::SOURCE_CARRIED;
  m.leader = "POSE_WHEEL";
  m.reason = "POSE_INS is silent";
  m.mode_name = {"constant_acceleration", "constant_turn"};
  m.mode_probability = {0.75, 0.25};
  m.channel_name = {"POSE_INS", "POSE_VO", "POSE_WHEEL"};
  m.channel_health = {fusion_state2_t::HEALTH_SILENT, fusion_state2_t::HEALTH_CONTRADICTED,
                      fusion_state2_t::HEALTH_GOOD};
  m.channel_weight = {0.0, 0.0, 1.0};
  m.channel_contradicts = {"", "POSE_WHEEL", "POSE_VO"};
  const std::string page = render_screen(some_report(Verdict::kDegraded), {160, 40}, false, fusion_lines(m));
  CHECK_THAT(page, Catch::Contains("fused pose: carried on by POSE_WHEEL; POSE_INS is silent; turns: 25 %"));
  CHECK_THAT(page, Catch::Contains("POSE_INS silent, POSE_VO contradicted (contradicts POSE_WHEEL), POSE_WHEEL 100 % "
                                   "(contradicts POSE_VO)"));
  m.source = fusion_state2_t::SOURCE_INS;
  m.reason.clear();
  m.channel_health[1] = 77;  // what no fusion says
  CHECK_THAT(fusion_lines(m)[0], Catch::Equals("fused pose: POSE_INS; turns: 25 %"));
  CHECK_THAT(fusion_lines(m)[1], Catch::Contains("POSE_VO unknown"));
}

TEST_CASE("a pose that is none has no numbers") {
  HealthReport report = some_report(Verdict::kDoNotUse);
  for (PoseReport& pose : report.poses) {
    pose.validity = Validity::kInvalid;
    pose.reason = "waits for a pose";
  }
  const std::string page = render_screen(report, {80, 40}, false);
  CHECK_THAT(page, Catch::Contains("POSE_FUSED is invalid: waits for a pose; this verdict for"));
  CHECK_THAT(page, !Catch::Contains("sure to"));
}

TEST_CASE("what comes from the bus cannot command the terminal") {
  HealthReport report = some_report(Verdict::kDegraded);
  report.reasons = {{"k", Verdict::kDegraded, 0, "evil \x1b[2J\x07 text\nsecond line"}};
  CHECK(render_screen(report, {80, 24}, false).find('\x1b') == std::string::npos);
  CHECK(lines_of(render_screen(report, {80, 24}, false)).size() == 24);
  CHECK(plain_line(report) == "22:13:20 DEGRADED: evil ?[2J? text?second line");
}
