#include "recorder/recording.h"

#include <sys/resource.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>

#include "bus/log/log_reader.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / ("roadfix_recorder_" + std::to_string(::getpid()))) {
    fs::remove_all(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] RecorderConfig config() const {
    RecorderConfig config;
    config.folder = path_.string();
    config.min_free = 0.0;
    config.flush_interval = 0.0;
    return config;
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

const std::vector<uint8_t> kData(100'000, 42);

int64_t events_in(const std::vector<fs::path>& files) {
  int64_t events = 0;
  for (const fs::path& file : files) {
    LogReader reader(file);
    while (reader.next()) ++events;
    CHECK(reader.damage().empty());
  }
  return events;
}

nlohmann::json sidecar(const fs::path& path) { return nlohmann::json::parse(std::ifstream(path)); }

TEST_CASE("a recording splits by size and by time and loses nothing") {
  const Folder folder;
  RecorderConfig config = folder.config();
  config.split_size = 1.0;
  config.split_time = 5.0;
  Recording recording(config, "20260101T000000Z");
  for (int i = 0; i < 30; ++i)
    recording.write("CAMERA_LEFT", 1'000'000 + i * 10'000, kData);  // 3 MB within a third of a second
  for (int i = 0; i < 12; ++i) recording.write("GNSS", 2'000'000 + i * 1'000'000, {kData.data(), 10});
  recording.close();
  CHECK(recording.files().size() >= 5);
  CHECK(events_in(recording.files()) == 42);
  const nlohmann::json facts = sidecar(folder.path() / "20260101T000000Z.json");
  CHECK(facts["files"].size() == recording.files().size());
  CHECK(facts["files"][0]["events"]["CAMERA_LEFT"] == 10);
  for (const nlohmann::json& file : facts["files"]) {
    std::ifstream stream(folder.path() / file["name"].get<std::string>(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    CHECK(file["bytes"] == bytes.size());
    StreamHash hash;
    hash.add(bytes.data(), bytes.size());
    std::ostringstream hex;
    hex << std::hex << std::setw(16) << std::setfill('0') << hash.value();
    CHECK(file["xxh64"] == hex.str());
  }
  CHECK_FALSE(facts["versions"]["build"].get<std::string>().empty());
  CHECK(facts["types"].size() >= 20);
  CHECK(facts["types"][0]["fingerprint"].get<std::string>().size() == 16);
  CHECK(facts["stopped_because"] == "");
}

TEST_CASE("recording stops before the disk is full and says why") {
  const Folder folder;
  RecorderConfig config = folder.config();
  config.min_free = 1.0;
  uint64_t free = uint64_t{2} << 30;
  Recording recording(config, "a", [&](const fs::path&) { return free; });
  recording.write("GNSS", 1, {kData.data(), 10});
  recording.flush(1);
  CHECK(recording.state() == Recording::State::kRecording);
  free = uint64_t{1} << 29;
  recording.flush(2);
  CHECK(recording.state() == Recording::State::kStopped);
  CHECK(recording.reason().find("min_free_gib") != std::string::npos);
  recording.write("GNSS", 3, {kData.data(), 10});
  CHECK(recording.unwritten() == 1);
  recording.close();
  CHECK(events_in(recording.files()) == 1);
  CHECK(sidecar(folder.path() / "a.json")["unwritten"] == 1);
}

TEST_CASE("over its quota a recording stops, or deletes the oldest files") {
  const bool ring = GENERATE(false, true);
  const Folder folder;
  RecorderConfig config = folder.config();
  config.split_size = 1.0;
  config.quota = 3.5 / 1024.0;
  config.when_full = ring ? WhenFull::kDeleteOldest : WhenFull::kStop;
  Recording recording(config, "a");
  for (int i = 0; i < 60; ++i) {
    recording.write("CAMERA_LEFT", 1 + i, kData);
    recording.flush(1 + i);
  }
  CHECK((recording.state() == Recording::State::kRecording) == ring);
  uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(folder.path()))
    if (entry.path().extension() == ".lcm") bytes += entry.file_size();
  CHECK(static_cast<double>(bytes) < 4.0 * kMebi);
  CHECK((recording.files_begun() > 5) == ring);
  CHECK(fs::exists(folder.path() / "a.000.lcm") != ring);
  for (const fs::path& file : recording.files()) CHECK(fs::exists(file));
  recording.close();
  const nlohmann::json facts = sidecar(folder.path() / "a.json");
  CHECK(facts["files"].size() == recording.files().size());
  CHECK(facts["deleted_files"] == recording.files_begun() - static_cast<int64_t>(recording.files().size()));
  CHECK((facts["deleted_files"] > 0) == ring);
}

TEST_CASE("the oldest file goes first, also behind the thousandth") {
  const Folder folder;
  RecorderConfig config = folder.config();
  config.quota = 1.5 / 1024.0;
  config.when_full = WhenFull::kDeleteOldest;
  fs::create_directories(folder.path());
  for (const char* name : {"a.999.lcm", "a.1000.lcm"}) {
    std::ofstream(folder.path() / name) << std::string(1 << 20, ' ');
  }
  const Recording recording(config, "b");
  CHECK_FALSE(fs::exists(folder.path() / "a.999.lcm"));
  CHECK(fs::exists(folder.path() / "a.1000.lcm"));
}

TEST_CASE("once there is room again, a stopped recording goes on in a new file, and the sidecar tells of the hole") {
  const Folder folder;
  RecorderConfig config = folder.config();
  config.min_free = 1.0;
  uint64_t free = uint64_t{1} << 29;
  Recording recording(config, "a", [&](const fs::path&) { return free; });
  REQUIRE(recording.state() == Recording::State::kStopped);
  recording.write("IMU", 1, std::vector<uint8_t>(8));
  free = (uint64_t{1} << 30) + 1;  // hardly more than the least: it would stop again at once
  REQUIRE_FALSE(recording.try_again());
  free = uint64_t{2} << 30;
  REQUIRE(recording.try_again());
  REQUIRE(recording.reason().empty());
  recording.write("IMU", 2, std::vector<uint8_t>(8));
  recording.close();
  CHECK(recording.files().size() == 2);
  CHECK(recording.unwritten() == 1);
  CHECK(sidecar(folder.path() / "a.json").dump().find("for a while: ") != std::string::npos);
}

TEST_CASE("a disk that takes no more ends the recording with a reason, not the program") {
  const Folder folder;
  Recording recording(folder.config(), "a");
  fs::remove_all(folder.path());
  // The next file cannot be made: its folder is gone.
  recording.write("GNSS", 1, {kData.data(), 10});
  recording.split();
  CHECK(recording.state() == Recording::State::kStopped);
  CHECK_FALSE(recording.reason().empty());
}

TEST_CASE("a channel's name that is no text ends no recording") {
  const Folder folder;
  Recording recording(folder.config(), "a");
  recording.write("\xB8\xFF", 1, {kData.data(), 10});
  recording.note_dropped({{"\xB8", 3}});
  CHECK_NOTHROW(recording.close());
  CHECK(sidecar(folder.path() / "a.json")["files"][0]["events"].size() == 1);
}

TEST_CASE("a recording never takes the place of another that began at the same second") {
  const Folder folder;
  for (const char* name : {"a", "a-2", "a-3"}) {
    Recording recording(folder.config(), "a");
    CHECK(recording.name() == name);
    for (int i = 0; i < 3; ++i) recording.write("GNSS", i + 1, {kData.data(), 10});
    recording.close();
  }
  CHECK(events_in({folder.path() / "a.000.lcm"}) == 3);
  CHECK(events_in({folder.path() / "a-2.000.lcm", folder.path() / "a-3.000.lcm"}) == 6);
  CHECK(sidecar(folder.path() / "a-2.json")["files"][0]["name"] == "a-2.000.lcm");
}

TEST_CASE("a limit on the size of files splits a recording, and what is larger than it is an error") {
  const Folder folder;
  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);  // as the recorder does
  rlimit small = before;
  small.rlim_cur = 250'000;
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  std::string reason;
  std::vector<fs::path> files;
  {
    Recording recording(folder.config(), "a");
    for (int i = 0; i < 5; ++i) {
      recording.write("GNSS", i + 1, kData);
      recording.flush(i + 1);
    }
    files = recording.files();
    reason = recording.reason();
    recording.write("GNSS", 9, std::vector<uint8_t>(300'000, 1));
    recording.flush(9);
    CHECK_THAT(recording.reason(), Catch::Contains("File too large"));
  }
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &before) == 0);
  std::signal(SIGXFSZ, handler);
  CHECK(reason.empty());
  CHECK(files.size() == 3);
  CHECK(events_in(files) == 5);
}

TEST_CASE("what was flushed survives the end of the program") {
  const Folder folder;
  Recording recording(folder.config(), "a");
  recording.write("GNSS", 1, {kData.data(), 10});
  recording.flush(1);
  LogReader reader(recording.files().front());  // while it is still being written, as after SIGKILL
  CHECK(reader.next()->channel == "GNSS");
}

}  // namespace
}  // namespace roadfix
