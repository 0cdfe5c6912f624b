// The command itself: exit codes and words that a user meets.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <functional>
#include <sstream>

#include <sys/wait.h>

#include "small_drive.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code = 0;
  std::string text;
};

/// Runs `roadfix import` inside the folder.
Outcome import(const fs::path& folder, const std::string& arguments) {
  const fs::path output = folder / "printed.txt";
  const std::string command =
      "cd '" + folder.string() + "' && '" ROADFIX_PROGRAM "' import " + arguments + " >'" + output.string() + "' 2>&1";
  const int status = std::system(command.c_str());
  return {WEXITSTATUS(status), test::read_file(output)};
}

TEST_CASE("import writes a log and a vehicle and says what went in") {
  const test::TemporaryFolder folder;
  fs::create_directories(folder / "drive");
  test::write_small_drive(folder / "drive");
  const Outcome outcome = import(folder.path(), "drive --out a.lcm --vehicle configs/small");
  INFO(outcome.text);
  CHECK(outcome.code == 0);
  CHECK_THAT(outcome.text, Catch::Contains("drive: format folder"));
  CHECK_THAT(outcome.text, Catch::Contains("IMU                 60"));
  CHECK(fs::exists(folder / "configs/small/calibration.yaml"));
  CHECK(fs::exists(folder / "configs/small/gnss_ins_ekf.yaml"));
  CHECK(import(folder.path(), "drive --out b.lcm --vehicle configs/small --format folder").code == 0);
  CHECK(test::read_file(folder / "a.lcm") == test::read_file(folder / "b.lcm"));
}

TEST_CASE("files whose times share no moment are refused with both spans and what to do") {
  const test::TemporaryFolder folder;
  const fs::path drive = folder / "drive";
  const auto with_stamps = [&](const std::string& file, const std::function<int64_t(int64_t)>& change) {
    fs::remove_all(drive);
    fs::create_directories(drive);
    test::write_small_drive(drive);
    std::istringstream lines(test::read_file(drive / file));
    std::string text, line;
    std::getline(lines, text);
    while (std::getline(lines, line)) {
      const std::size_t comma = line.find(',');
      text += "\n" + std::to_string(change(std::stoll(line.substr(0, comma)))) + line.substr(comma);
    }
    test::write_file(drive / file, text + "\n");
    return import(folder.path(), "drive --out a.lcm --overwrite");
  };
  const std::string spans =
      " shares no moment with drive/imu.csv, 1700000000000000 to 1700000002950000: it looks like ";
  const std::string advice = "; give both in microseconds of one clock, or leave a sensor out with --without";
  Outcome outcome = with_stamps("gnss.csv", [](int64_t t_us) { return t_us / 1000; });
  CHECK(outcome.code == 2);
  CHECK_THAT(outcome.text, Catch::Contains("drive/gnss.csv: utime_us from 1700000000000 to 1700000002750" + spans +
                                           "milliseconds" + advice));
  CHECK_FALSE(fs::exists(folder / "a.lcm"));
  CHECK(import(folder.path(), "drive --out a.lcm --overwrite --without gnss").code == 0);
  outcome = with_stamps("wheels.csv", [](int64_t t_us) { return t_us / 1'000'000; });
  CHECK(outcome.code == 2);
  CHECK_THAT(outcome.text,
             Catch::Contains("drive/wheels.csv: utime_us from 1700000000 to 1700000002" + spans + "seconds" + advice));
  outcome = with_stamps("imu.csv", [](int64_t t_us) { return t_us / 1000; });
  CHECK_THAT(outcome.text, Catch::Contains("drive/imu.csv: utime_us from 1700000000000 to 1700000002950") &&
                               Catch::Contains("it looks like milliseconds"));
  outcome = with_stamps("mag.csv", [](int64_t t_us) { return t_us + 3'600'000'000; });  // an hour: another clock
  CHECK(outcome.code == 2);
  CHECK_THAT(outcome.text, Catch::Contains("drive/mag.csv") && !Catch::Contains("looks like"));
  CHECK(import(folder.path(), "drive --out a.lcm --overwrite --without mag").code == 0);
  CHECK(with_stamps("gnss.csv", [](int64_t t_us) { return t_us + 2'900'000; }).code ==
        0);  // with the IMU 50 ms, with pictures none
}

TEST_CASE("a user's mistake ends with exit code 2 and a line that names it") {
  const test::TemporaryFolder folder;
  fs::create_directories(folder / "drive");
  test::write_small_drive(folder / "drive");
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {"nowhere --out a.lcm", "roadfix import: nowhere: no such file or folder"},
      {"drive", "--out is required"},
      {"drive --out a.lcm --format rinex", "--format"},
      {"drive --out a.lcm --without radar", "--without"},
      {"drive --out a.lcm --cut-gnss 1", "--cut-gnss requires --every"},
      {"drive --out a.lcm --cut-gnss 5 --every 1", "roadfix import: --every must not be shorter than --cut-gnss"},
      {"drive --out a.lcm --cut-gnss inf --every inf", "--cut-gnss"},
      {"drive --out a.lcm --cut-gnss 1 --every 5 --after nan", "--after"},
      {"drive --out a.lcm --gnss-spike nan --every-fix 2", "--gnss-spike"},
      {"drive --out a.lcm --gnss-bias-after-outage 15", "--gnss-bias-after-outage requires --cut-gnss"},
      {"drive --out a.lcm --gnss-every 0", "--gnss-every"},
      {"drive --out a.lcm --gnss-every 2 --without gnss",
       "roadfix import: there are no fixes to cut, thin out or move"},
      {"drive --out no/such/folder/a.lcm", "no/such/folder/a.lcm"},
      {"drive --out a.lcm --start-after 1e9", "roadfix import: nothing is left of the drive"},
  };
  for (const auto& [arguments, words] : mistakes) {
    const Outcome outcome = import(folder.path(), arguments);
    INFO(arguments << ": " << outcome.text);
    CHECK(outcome.code == 2);
    CHECK_THAT(outcome.text, Catch::Contains(words));
    CHECK_FALSE(fs::exists(folder / "a.lcm"));
  }
}

TEST_CASE("a picture whose end is missing stops an import with the file's name") {
  const test::TemporaryFolder folder;
  const fs::path drive = folder / "drive";
  fs::create_directories(drive);
  test::write_small_drive(drive);
  const std::string whole = test::read_file(drive / "images/l1.png");
  test::write_file(drive / "images/l1.png", whole.substr(0, whole.size() - 14));
  const Outcome outcome = import(folder.path(), "drive --out a.lcm");
  INFO(outcome.text);
  CHECK(outcome.code == 2);
  CHECK_THAT(outcome.text, Catch::Contains("drive/images/l1.png: is cut short"));
  CHECK_FALSE(fs::exists(folder / "a.lcm"));
}

}  // namespace
}  // namespace roadfix
