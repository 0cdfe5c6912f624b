// Writing gives the effective values; read back they are the same bits.
#include <bit>
#include <catch2/catch.hpp>
#include <limits>
#include <random>

#include "config/config.h"
#include "sample_config.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

using test::SampleConfig;

SampleConfig round_trip(const SampleConfig& config) {
  return parse_config<SampleConfig>(config_text(config), "written.yaml");
}

TEST_CASE("defaults are written out and unknown values are left out") {
  const std::string text = config_text(SampleConfig{});
  CHECK_THAT(text,
             Catch::StartsWith("name: none\ngyro_noise_radps_per_rthz: 0.001\nwindow: 10\nuse_mag: true\nmode: klt\n"));
  CHECK_THAT(text, Catch::Contains("lever_arm_m: [0, 0, 0]\nsoft: [[1, 0], [0, 1]]\n"));
  CHECK_THAT(text, Catch::EndsWith("gates: []\ngate:\n  time_s: 1.5\n"));
  CHECK_THAT(text, !Catch::Contains("x_m"));
}

TEST_CASE("an explained text names what else a choice could be, and reads back as the same values") {
  SampleConfig config;
  config.modes = {test::Mode::kOrb};
  const std::string text = explained_config_text(config);
  CHECK_THAT(text, Catch::Contains("\nmode: klt  # or: orb\n"));
  CHECK_THAT(text, Catch::Contains("\nmodes: [orb]  # or: klt\n"));
  CHECK(config_text(parse_config<SampleConfig>(text, "explained.yaml")) == config_text(config));
  CHECK_THAT(config_text(config), !Catch::Contains("#"));
}

TEST_CASE("written values come back with the same bits") {
  std::mt19937_64 random(7);
  SampleConfig config;
  for (int i = 0; i < 2000; ++i) {
    const double any = std::bit_cast<double>(random());
    if (std::isfinite(any) && std::abs(any) <= 1e308) config.x = any;
    config.lever_arm = Eigen::Vector3d(1.0, -1.0, 0.5) * (static_cast<double>(random()) / 1e19);
    config.soft(0, 1) = -0.0;
    config.stamps = {std::numeric_limits<int64_t>::min(), static_cast<int64_t>(random())};
    const SampleConfig back = round_trip(config);
    REQUIRE(back.x.has_value() == config.x.has_value());
    if (config.x) REQUIRE(std::bit_cast<uint64_t>(*back.x) == std::bit_cast<uint64_t>(*config.x));
    REQUIRE(back.lever_arm == config.lever_arm);
    REQUIRE(std::signbit(back.soft(0, 1)));
    REQUIRE(back.stamps == config.stamps);
  }
}

TEST_CASE("every text comes back as it was") {
  for (const std::string text :
       {"",      "a",      "null",          "~",     "true",     "12",      "1e5",         " x",
        "x ",    "a: b",   "a # b",         "#",     "'q'",      "\"q\"",   "back\\slash", "line\nbreak",
        "tab\t", "- item", "[list]",        "{map}", "*alias",   "&anchor", "!tag",        "%dir",
        "@",     "`",      "grad \xc3\xbc", "a, b",  "\x01\x7f", "?",       "key:"}) {
    INFO(text);
    SampleConfig config;
    config.name = text;
    config.words = {text, "other", text};
    config.note = text;
    const SampleConfig back = round_trip(config);
    CHECK(back.name == text);
    CHECK(back.words == config.words);
    CHECK(back.note == text);
  }
}

TEST_CASE("groups and lists of groups come back") {
  SampleConfig config;
  config.gates = {{0.25}, {9.0}};
  config.extra = test::Gate{4.0};
  config.modes = {test::Mode::kOrb, test::Mode::kOrb};
  config.weights = {0.1, 1.0 / 3.0};
  const SampleConfig back = round_trip(config);
  CHECK(config_text(back) == config_text(config));
  CHECK(back.gates[1].time == 9.0);
  CHECK(back.weights == config.weights);
}

struct Empty {};
template <class Visitor>
void visit(Empty&, Visitor&) {}
struct Holder {
  Empty empty;
  std::vector<Empty> empties = {Empty{}, Empty{}};
};
template <class Visitor>
void visit(Holder& c, Visitor& v) {
  v.group("empty", c.empty);
  v.groups("empties", c.empties);
}

TEST_CASE("a group without values is written so that it can be read") {
  CHECK(config_text(Holder{}) == "empty: {}\nempties:\n  - {}\n  - {}\n");
  CHECK(parse_config<Holder>(config_text(Holder{}), "f").empties.size() == 2);
}

TEST_CASE("a text is written whole or not at all, through links and to devices, and over no log") {
  namespace fs = std::filesystem;
  const test::TemporaryFolder folder;
  write_text_file(folder / "new/a.yaml", "one");
  fs::create_symlink("new/a.yaml", folder / "link.yaml");
  write_text_file(folder / "link.yaml", "two");
  CHECK(fs::is_symlink(folder / "link.yaml"));
  CHECK(read_text_file(folder / "new/a.yaml") == "two");
  write_text_file("/dev/null", "three");
  CHECK(fs::is_character_file("/dev/null"));
  if (fs::exists("/dev/full"))
    CHECK_THROWS_WITH(write_text_file("/dev/full", "four"), Catch::Contains("No space left"));
  const std::string log = "\xED\xA1\xDA\x01 and so on";
  write_text_file(folder / "a.lcm", log);
  CHECK_THROWS_WITH(write_text_file(folder / "a.lcm", "five"), Catch::Contains("is a log"));
  CHECK(read_text_file(folder / "a.lcm") == log);
  CHECK_THROWS_WITH(write_text_file(folder / "new/a.yaml/b.yaml", "six"), Catch::Contains("folder"));
  CHECK_THROWS_WITH(write_text_file(folder / "new", "seven"), Catch::Contains("Is a directory"));
  for (const auto& entry : fs::recursive_directory_iterator(folder.path())) CHECK(entry.path().extension() != ".part");
}

}  // namespace
}  // namespace roadfix
