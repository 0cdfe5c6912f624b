#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <random>
#include <thread>

#include "bus/log/log_reader.h"
#include "bus/log/log_writer.h"
#include "bus/log/output_place.h"
#include "support/temporary_folder.h"

using namespace roadfix;

namespace {

constexpr int kEvents = 300;

/// Different for each i, also in length; contains no log magic.
std::vector<uint8_t> payload(int i) {
  std::vector<uint8_t> bytes(static_cast<std::size_t>(10 + i % 37));
  for (std::size_t k = 0; k < bytes.size(); ++k)
    bytes[k] = static_cast<uint8_t>((k * 7 + static_cast<std::size_t>(i)) % 200);
  return bytes;
}

void write_log(const std::filesystem::path& path) {
  LogWriter writer(path);
  for (int i = 0; i < kEvents; ++i) writer.write(i % 3 == 0 ? "GNSS" : "IMU", 1'000'000 + i, payload(i));
  writer.commit();
}

std::string read_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

/// The numbers of the events that come back with exactly their own contents.
std::vector<int> intact_events(LogReader& reader) {
  std::vector<int> numbers;
  while (const auto event = reader.next()) {
    const auto i = static_cast<int>(event->eventnum);
    const std::vector<uint8_t> expected = payload(i);
    REQUIRE(std::equal(event->data.begin(), event->data.end(), expected.begin(), expected.end()));
    numbers.push_back(i);
  }
  return numbers;
}

}  // namespace

TEST_CASE("a written log comes back, also through LCM's own reader") {
  test::TemporaryFolder folder;
  write_log(folder / "a.lcm");
  LogReader reader(folder / "a.lcm");
  REQUIRE(intact_events(reader).size() == kEvents);
  REQUIRE(reader.damage().empty());

  lcm::LogFile theirs((folder / "a.lcm").string(), "r");
  for (int i = 0; i < kEvents; ++i) {
    const lcm::LogEvent* event = theirs.readNextEvent();
    REQUIRE(event != nullptr);
    REQUIRE(event->timestamp == 1'000'000 + i);
    REQUIRE(event->channel == (i % 3 == 0 ? "GNSS" : "IMU"));
    REQUIRE(event->datalen == static_cast<int>(payload(i).size()));
  }
  REQUIRE(theirs.readNextEvent() == nullptr);
}

TEST_CASE("a log that LCM wrote is read to the same events") {
  test::TemporaryFolder folder;
  {
    lcm::LogFile theirs((folder / "a.lcm").string(), "w");
    for (int i = 0; i < kEvents; ++i) {
      std::vector<uint8_t> bytes = payload(i);
      lcm::LogEvent event{};
      event.timestamp = i;
      event.channel = "IMU";
      event.datalen = static_cast<int>(bytes.size());
      event.data = bytes.data();
      REQUIRE(theirs.writeEvent(&event) == 0);
    }
  }
  LogReader reader(folder / "a.lcm");
  REQUIRE(intact_events(reader).size() == kEvents);
  REQUIRE(reader.damage().empty());
}

TEST_CASE("a log that is not committed leaves nothing under its name") {
  test::TemporaryFolder folder;
  {
    LogWriter writer(folder / "a.lcm");
    writer.write("IMU", 1, payload(1));
    writer.flush(true);
    REQUIRE_FALSE(std::filesystem::exists(folder / "a.lcm"));
    REQUIRE_THROWS_AS(LogWriter(folder / "a.lcm"), LogError);  // two writers of one log
  }
  REQUIRE(std::filesystem::is_empty(folder / ""));
}

TEST_CASE("a log written to a device or a pipe goes there and leaves the device in its place") {
  test::TemporaryFolder folder;
  std::filesystem::create_symlink("/dev/null", folder / "null");  // what goes wrong here costs the link, not the device
  write_log(folder / "null");
  REQUIRE(std::filesystem::is_character_file(folder / "null"));
  LogWriter one(folder / "null");
  LogWriter other(folder / "null");  // nobody owns it

  write_log(folder / "a.lcm");
  REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
  REQUIRE_THROWS_WITH(LogReader(folder / "pipe"), Catch::Contains("not a regular file"));  // and waits for nobody
  std::string through;
  std::thread reader([&] { through = read_bytes(folder / "pipe"); });
  write_log(folder / "pipe");
  reader.join();
  REQUIRE(through == read_bytes(folder / "a.lcm"));
  REQUIRE(std::filesystem::is_fifo(folder / "pipe"));
  if (!std::filesystem::exists("/dev/full")) return;
  std::filesystem::create_symlink("/dev/full", folder / "full");
  LogWriter full(folder / "full");
  full.write("IMU", 1, payload(1));
  REQUIRE_THROWS_WITH(full.commit(), Catch::Contains("No space left"));
}

TEST_CASE("a log written to a link's name takes the place of the file behind it") {
  test::TemporaryFolder folder;
  write_log(folder / "a.lcm");
  const std::string whole = read_bytes(folder / "a.lcm");
  {
    LogWriter writer(folder / "real.lcm");
    writer.commit();
  }
  std::filesystem::create_symlink("real.lcm", folder / "link.lcm");
  write_log(folder / "link.lcm");
  REQUIRE(std::filesystem::is_symlink(folder / "link.lcm"));
  REQUIRE(read_bytes(folder / "real.lcm") == whole);
}

TEST_CASE("a log takes the place of no other kind of file, and of no folder") {
  test::TemporaryFolder folder;
  write_bytes(folder / "calibration.yaml", "body_origin: imu\n");
  REQUIRE_THROWS_WITH(LogWriter(folder / "calibration.yaml"), Catch::Contains("is there and no log"));
  REQUIRE(read_bytes(folder / "calibration.yaml") == "body_origin: imu\n");
  REQUIRE_THROWS_WITH(LogWriter(folder.path()), Catch::Contains("Is a directory"));
  REQUIRE_FALSE(std::filesystem::exists(folder.path().string() + ".part"));
  write_log(folder / "a.lcm");
  {
    LogWriter unfinished(folder / "a.lcm");
    unfinished.write("IMU", 1, payload(1));
    unfinished.flush(true);
  }
  LogReader reader(folder / "a.lcm");  // a run that fails leaves what was there
  REQUIRE(intact_events(reader).size() == kEvents);
  write_log(folder / "a.lcm");
}

TEST_CASE("an output may be an input under no name") {
  test::TemporaryFolder folder;
  write_log(folder / "a.lcm");
  write_log(folder / "b.lcm.part");  // left by a run that was killed
  std::filesystem::create_symlink("a.lcm", folder / "link.lcm");
  std::filesystem::create_hard_link(folder / "a.lcm", folder / "hard.lcm");
  const auto replaces = Catch::Contains("would replace the input");
  for (const char* out : {"a.lcm", "link.lcm", "hard.lcm"}) {
    CAPTURE(out);
    REQUIRE_THROWS_WITH(refuse_to_replace(folder / "a.lcm", folder / out), replaces);
  }
  REQUIRE_THROWS_WITH(refuse_to_replace(folder / "b.lcm.part", folder / "b.lcm"), replaces);
  REQUIRE_NOTHROW(refuse_to_replace(folder / "a.lcm", folder / "b.lcm"));
  REQUIRE_NOTHROW(refuse_to_replace(folder / "a.lcm", "/dev/null"));
}

TEST_CASE("a full disk is an error and leaves nothing plausible") {
  if (!std::filesystem::exists("/dev/full")) return;
  LogWriter writer("/dev/full", LogWriter::Mode::kRecording);
  writer.write("IMU", 1, payload(1));
  REQUIRE_THROWS_WITH(writer.flush(false), Catch::Contains("No space left"));
}

TEST_CASE("truncated at any byte: all whole events come back and the rest is reported") {
  test::TemporaryFolder folder;
  write_log(folder / "a.lcm");
  const std::string whole = read_bytes(folder / "a.lcm");
  std::vector<std::size_t> ends{0};
  {
    LogReader reader(folder / "a.lcm");
    while (const auto event = reader.next()) ends.push_back(event->offset + log_event_bytes(*event));
  }
  // The last events byte by byte, the whole file in strides that meet every place of an event.
  for (std::size_t size = 0; size <= whole.size(); size += size + 400 < whole.size() ? 11 : 1) {
    write_bytes(folder / "b.lcm", whole.substr(0, size));
    LogReader reader(folder / "b.lcm");
    const auto expected = static_cast<std::size_t>(std::upper_bound(ends.begin(), ends.end(), size) - ends.begin()) - 1;
    REQUIRE(intact_events(reader).size() == expected);
    REQUIRE(reader.damage().size() == (ends[expected] == size ? 0U : 1U));
  }
}

TEST_CASE("a hundred broken heads cost exactly their own events") {
  test::TemporaryFolder folder;
  write_log(folder / "a.lcm");
  std::string bytes = read_bytes(folder / "a.lcm");
  std::vector<std::size_t> offsets;
  {
    LogReader reader(folder / "a.lcm");
    while (const auto event = reader.next()) offsets.push_back(event->offset);
  }
  std::vector<int> numbers(kEvents);
  for (int i = 0; i < kEvents; ++i) numbers[static_cast<std::size_t>(i)] = i;
  std::mt19937 random(7);
  std::shuffle(numbers.begin(), numbers.end(), random);
  for (int k = 0; k < 100; ++k) {
    for (std::size_t byte = 0; byte < 4; ++byte)
      bytes[offsets[static_cast<std::size_t>(numbers[static_cast<std::size_t>(k)])] + byte] = 'x';
  }
  write_bytes(folder / "b.lcm", bytes);
  LogReader reader(folder / "b.lcm");
  std::vector<int> expected(numbers.begin() + 100, numbers.end());
  std::sort(expected.begin(), expected.end());
  REQUIRE(intact_events(reader) == expected);
  uint64_t damaged = 0;
  for (const LogDamage& damage : reader.damage()) damaged += damage.bytes;
  uint64_t lost = 0;
  for (int k = 0; k < 100; ++k) {
    const int i = numbers[static_cast<std::size_t>(k)];
    lost += kLogHeadBytes + (i % 3 == 0 ? 4U : 3U) + payload(i).size();
  }
  REQUIRE(damaged == lost);
}

TEST_CASE("a wrong length does not swallow the events behind it") {
  test::TemporaryFolder folder;
  write_log(folder / "a.lcm");
  std::string bytes = read_bytes(folder / "a.lcm");
  LogReader whole(folder / "a.lcm");
  uint64_t offset = 0;
  for (int i = 0; i <= 50; ++i) offset = whole.next()->offset;
  for (const char length : {'\x00', '\x01', '\x7f'}) {
    bytes[offset + 25] = length;  // 0, 65536 or 8 million bytes more than there are
    bytes[offset + 27] = '\x70';
    write_bytes(folder / "b.lcm", bytes);
    LogReader reader(folder / "b.lcm");
    const std::vector<int> numbers = intact_events(reader);
    REQUIRE(numbers.size() == kEvents - 1);
    REQUIRE(reader.damage().size() == 1);
    REQUIRE(reader.damage()[0].offset == offset);
  }
}
