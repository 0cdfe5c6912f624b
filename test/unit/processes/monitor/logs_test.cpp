// The monitor over logs: the same verdicts each time, those that the demo drive deserves.
#include <catch2/catch.hpp>
#include <fstream>
#include <roadfix/imu_t.hpp>

#include "bus/log/log_writer.h"
#include "bus/log/merged_logs.h"
#include "bus/run/replay.h"
#include "bus/types/message.h"
#include "monitor/handler.h"
#include "roadfix/stages.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

using namespace roadfix;

namespace {

/// The demo drive's estimates, replayed once.
const std::filesystem::path& estimates() {
  static const test::TemporaryFolder kFolder;
  static const std::filesystem::path kLog = [] {
    const std::filesystem::path out = kFolder.path() / "out.lcm";
    const std::filesystem::path vehicle = test::source_path("configs/demo");
    replay(test::source_path("logs/demo.lcm"), out,
           make_stages({"wheel_odometry", "gnss_ins_ekf", "imm_fusion"}, vehicle));
    return out;
  }();
  return kLog;
}

struct Verdicts : MonitorListener {
  std::vector<HealthReport> reports;
  void message(const std::string&, const std::string&, const BusMessage&, int64_t) override {}
  void decided(const HealthReport& report, bool) override { reports.push_back(report); }
};

std::vector<HealthReport> monitored(const std::vector<std::filesystem::path>& paths) {
  const MonitorConfig config;
  Expectations expectations = expectations_of(config, test::source_path("configs/demo"));
  expectations.processes.clear();
  MonitorHandler handler(config, expectations);
  Verdicts verdicts;
  handler.add(verdicts);
  MergedLogs logs(paths);
  while (const auto event = logs.next()) handler.take({event->channel, event->bytes, event->at_us}, event->at_us);
  return verdicts.reports;
}

/// Share of the decisions between two times of the drive that have this verdict.
double share(const std::vector<HealthReport>& reports, double from, double to, Verdict verdict) {
  int all = 0, same = 0;
  for (const HealthReport& report : reports) {
    const double t = static_cast<double>(report.now_us - reports.front().now_us) * 1e-6;
    if (t < from || t >= to) continue;
    ++all;
    same += report.verdict == verdict ? 1 : 0;
  }
  return all == 0 ? -1.0 : static_cast<double>(same) / all;
}

}  // namespace

TEST_CASE(
    "the demo drive: not before there is a pose, not OK before it is aligned, degraded in the tunnel, well before and "
    "after") {
  const std::vector<HealthReport> reports = monitored({test::source_path("logs/demo.lcm"), estimates()});
  CHECK(reports.size() > 890);
  CHECK(share(reports, 0.0, 0.5, Verdict::kDoNotUse) == 1.0);
  CHECK(share(reports, 1.0, 2.0, Verdict::kOk) == 0.0);  // a pose in a local frame
  CHECK(share(reports, 4.0, 20.0, Verdict::kOk) == 1.0);
  CHECK(share(reports, 31.0, 60.0, Verdict::kDegraded) == 1.0);
  CHECK(share(reports, 63.0, 90.0, Verdict::kOk) > 0.95);
}

TEST_CASE("a log gives the same reports each time") {
  const auto text = [] {
    std::string all;
    for (const HealthReport& r : monitored({test::source_path("logs/demo.lcm"), estimates()})) {
      all += std::to_string(r.now_us) + " " + std::to_string(static_cast<int>(r.verdict));
      for (const Condition& reason : r.reasons) all += " " + reason.text;
      for (const ChannelReport& c : r.channels)
        all += " " + std::to_string(c.rate_hz) + " " + std::to_string(c.jitter_s);
    }
    return all;
  };
  CHECK(text() == text());
}

TEST_CASE("without the estimates the drive is not to be used") {
  const std::vector<HealthReport> reports = monitored({test::source_path("logs/demo.lcm")});
  CHECK(share(reports, 0.0, 90.0, Verdict::kDoNotUse) == 1.0);
}

TEST_CASE("logs are merged by time, one recorded while it was played is put back") {
  const test::TemporaryFolder folder;
  constexpr int64_t kStart_us = 1'700'000'000'000'000;
  const auto write = [&](const char* name, int64_t offset_us, int64_t late_us) {
    LogWriter writer(folder.path() / name);
    for (int64_t i = 0; i < 10; ++i) {
      imu_t imu{};
      imu.utime = kStart_us + i * 1'000'000 + offset_us;
      writer.write(name, imu.utime + late_us, encode(imu));
    }
    writer.commit();
    return folder.path() / name;
  };
  const auto a = write("A", 0, 0);
  const auto b = write("B", 500'000, int64_t{86'400} * 1'000'000);
  MergedLogs logs({a, b});
  std::string order;
  while (const auto event = logs.next()) order += event->channel;
  CHECK(order == "ABABABABABABABABABAB");
  MergedLogs twice({a, a});
  int once = 0;
  while (twice.next()) ++once;
  CHECK(once == 10);
  CHECK(logs.share_done() == 1.0);
}

TEST_CASE("what is no log is no drive that was silent") {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "empty.lcm").close();
  std::ofstream(folder / "text.lcm") << "not a log";
  CHECK_THROWS_WITH(MergedLogs({estimates(), folder / "empty.lcm"}), Catch::Contains("empty.lcm: is empty"));
  CHECK_THROWS_WITH(MergedLogs({folder / "text.lcm"}), Catch::Contains("is no LCM log"));
}
