#include "bus/log/log_survey.h"

#include <catch2/catch.hpp>
#include <limits>

#include "support/small_drive.h"
#include "support/temporary_folder.h"

using namespace roadfix;
using namespace roadfix::test;

TEST_CASE("a survey counts channels, rates, runs, gaps, repetitions and what is broken") {
  const TemporaryFolder folder;
  std::vector<DriveMessage> drive = small_drive(10.0);
  std::erase_if(drive, [](const DriveMessage& m) { return m.channel == "IMU" && m.header.seq / 3 == 100; });
  const auto is_gnss = [](int64_t seq) {
    return [seq](const DriveMessage& m) { return m.channel == "GNSS" && m.header.seq == seq; };
  };
  std::find_if(drive.begin(), drive.end(), is_gnss(7))->bytes.pop_back();
  drive.push_back(*std::find_if(drive.begin(), drive.end(), is_gnss(3)));
  drive.push_back({"FOREIGN", {drive.back().header.utime, 0, 0}, {1, 2, 3}});
  write_drive(folder / "a.lcm", drive);
  LogReader reader(folder / "a.lcm");
  const LogSurvey survey = survey_log(reader);
  REQUIRE(survey.events == static_cast<int64_t>(drive.size()));
  REQUIRE(survey.backward_stamps == 1);
  REQUIRE(survey.damage.empty());
  const ChannelSurvey& imu = survey.channels.at("IMU");
  REQUIRE((imu.type == "imu_t" && imu.events == 997 && imu.missing == 3 && imu.runs.size() == 1));
  REQUIRE(imu.rate_hz() == Approx(99.7).margin(0.2));
  const ChannelSurvey& gnss = survey.channels.at("GNSS");
  REQUIRE((gnss.undecodable == 1 && gnss.missing == 1 && gnss.repeated == 1));
  REQUIRE(survey.channels.at("WHEELS").missing == 0);
  REQUIRE(survey.channels.at("FOREIGN").type == "unknown");
}

TEST_CASE("a survey tells stamps that contradict their seq, and does not take them for the channel's span") {
  const TemporaryFolder folder;
  std::vector<DriveMessage> drive = small_drive(10.0);
  const auto stamp = [&](int64_t seq, int64_t utime) {
    for (DriveMessage& m : drive) {
      if (m.channel == "IMU" && m.header.seq == seq)
        m = drive_message("IMU", utime, seq, decode<imu_t>(std::span<const uint8_t>(m.bytes)));
    }
  };
  stamp(100, kDriveStart_us);                          // a second early
  stamp(500, kDriveStart_us + 8'000'000);              // three seconds late
  stamp(999, kDriveStart_us + 1'000'000'000'000'000);  // 32 years; by seq nothing contradicts it
  stamp(0, std::numeric_limits<int64_t>::min());
  write_drive(folder / "a.lcm", drive);
  LogReader reader(folder / "a.lcm");
  const LogSurvey survey = survey_log(reader);
  const ChannelSurvey& imu = survey.channels.at("IMU");
  CHECK(imu.misstamped == 4);
  CHECK(imu.missing + imu.repeated + imu.undecodable == 0);
  CHECK(imu.first_utime == kDriveStart_us + 10'000);
  CHECK(imu.last_utime == kDriveStart_us + 9'980'000);
  CHECK(survey.channels.at("GNSS").misstamped == 0);
}
