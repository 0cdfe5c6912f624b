// Strict reading: what a user gets wrong is told with file, line, key, value and allowed range.
#include <catch2/catch.hpp>

#include "config/config.h"
#include "sample_config.h"

namespace roadfix {
namespace {

using test::SampleConfig;

std::string error_of(const std::string& text) {
  try {
    parse_config<SampleConfig>(text, "car.yaml");
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

struct Mistake {
  const char* text;
  const char* error;
};

TEST_CASE("an absent key keeps its default and a present one replaces it") {
  const auto config =
      parse_config<SampleConfig>("window: 12\ngate:\n  time_s: 2.5\nlever_arm_m: [1, 2.5, -3e-1]\n", "f");
  CHECK(config.window == 12);
  CHECK(config.gate.time == 2.5);
  CHECK(config.lever_arm == Eigen::Vector3d(1.0, 2.5, -0.3));
  CHECK(config.gyro_noise == 1e-3);
  CHECK_FALSE(config.x.has_value());
  CHECK(parse_config<SampleConfig>("", "f").window == 10);
  CHECK(parse_config<SampleConfig>("# only a comment\n", "f").window == 10);
}

TEST_CASE("every kind of key is read") {
  const auto config = parse_config<SampleConfig>(
      "name: a car\nuse_mag: false\nmode: orb\nsoft: [[1, 2], [0.5, -1]]\nx_m: +1.5\nwidth_px: 7\non: true\nnote: "
      "\"12\"\n"
      "other_mode: klt\npoint_m: [0.5, -0.5]\nextra: {time_s: 3}\nweights: [0.5, 1]\nstamps: [-5, 1600357473000000]\n"
      "words: [a, \"b c\"]\nmodes: [orb, klt]\ngates: [{time_s: 1}, {}]\n",
      "f");
  CHECK(config.name == "a car");
  CHECK_FALSE(config.use_mag);
  CHECK(config.mode == test::Mode::kOrb);
  CHECK(config.soft(0, 1) == 2.0);
  CHECK(config.soft(1, 0) == 0.5);
  CHECK(config.x == 1.5);
  CHECK(config.width == 7);
  CHECK(config.on == true);
  CHECK(config.note == "12");
  CHECK(config.other_mode == test::Mode::kKlt);
  CHECK(config.point->y() == -0.5);
  CHECK(config.extra->time == 3.0);
  CHECK(config.weights == std::vector<double>{0.5, 1.0});
  CHECK(config.stamps == std::vector<int64_t>{-5, 1600357473000000});
  CHECK(config.words == std::vector<std::string>{"a", "b c"});
  CHECK(config.modes == std::vector<test::Mode>{test::Mode::kOrb, test::Mode::kKlt});
  CHECK(config.gates.size() == 2);
  CHECK(config.gates[1].time == 1.5);
}

TEST_CASE("each mistake gives the error a user needs") {
  const std::vector<Mistake> mistakes = {
      {"gyro_noise_degps_per_rthz: 0.1\n",
       "car.yaml:1: gyro_noise_degps_per_rthz is unknown, did you mean gyro_noise_radps_per_rthz?"},
      {"\nlever_arm_mm: [1, 2, 3]\n", "car.yaml:2: lever_arm_mm is unknown, did you mean lever_arm_m?"},
      {"windo: 3\n", "car.yaml:1: windo is unknown, did you mean window?"},
      {"gate:\n  tme_s: 1\n", "car.yaml:2: gate.tme_s is unknown, did you mean time_s?"},
      {"gates:\n  - time_s: 1\n  - time_ms: 4\n", "car.yaml:3: gates[1].time_ms is unknown, did you mean time_s?"},
      {"window: 10\nwindow: 12\n", "car.yaml:2: window is there twice (first in line 1)"},
      {"window: abc\n", "car.yaml:1: window = abc: is not a whole number; allowed: 1 to 1000"},
      {"window: 2.5\n", "car.yaml:1: window = 2.5: is not a whole number; allowed: 1 to 1000"},
      {"window: 1002\n", "car.yaml:1: window = 1002: is out of range; allowed: 1 to 1000"},
      {"window: 11\n", "car.yaml:1: window = 11: must be even"},
      {"window: 99999999999999999999\n", "is not a whole number"},
      {"gyro_noise_radps_per_rthz: 2\n", "gyro_noise_radps_per_rthz = 2: is out of range; allowed: 1e-07 to 1"},
      {"gyro_noise_radps_per_rthz: nan\n", "gyro_noise_radps_per_rthz = nan: is not a finite number"},
      {"gyro_noise_radps_per_rthz: .nan\n", "= .nan: is not a number"},
      {"gyro_noise_radps_per_rthz: inf\n", "= inf: is not a finite number"},
      {"gyro_noise_radps_per_rthz: \"0.1\"\n", "= \"0.1\": is not a number"},
      {"gyro_noise_radps_per_rthz: 0.1 rad\n", "= 0.1 rad: is not a number"},
      {"gyro_noise_radps_per_rthz: 0,1\n", "= 0,1: is not a number"},
      {"gyro_noise_radps_per_rthz:\n", "= nothing: is not a number"},
      {"gyro_noise_radps_per_rthz: [1]\n", "= a list: is not a number"},
      {"use_mag: yes\n", "car.yaml:1: use_mag = yes: must be true or false"},
      {"mode: sift\n", "car.yaml:1: mode = sift: must be one of klt, orb"},
      {"modes: [klt, sift]\n", "modes[1] = sift: must be one of klt, orb"},
      {"lever_arm_m: [1, 2]\n", "lever_arm_m = a list: has 2 entries, must have 3"},
      {"lever_arm_m: [1, 2, x]\n", "lever_arm_m[2] = x: is not a number; allowed: -20 to 20"},
      {"lever_arm_m: 5\n", "lever_arm_m = 5: must be a list of 3 numbers"},
      {"soft: [[1, 2], [3]]\n", "soft[1] = a list: has 1 entries, must have 2"},
      {"gate: 5\n", "gate = 5: must be a map"},
      {"weights: 0.5\n", "weights = 0.5: must be a list"},
      {"name: [a]\n", "name = a list: must be text"},
      {"name:\n", "name = nothing: must be text"},
      {"- 1\n- 2\n", "car.yaml:1: must be a map of keys and values"},
      {"a: &x 1\nb: *x\n", "car.yaml:1: an anchor (&) is not allowed here"},
      {"name: !!str x\n", "a tag (tag:yaml.org,2002:str) is not allowed here"},
      {"[1, 2]: 3\n", "a list cannot be a key: a key is a word"},
      {"window: 10\n---\nwindow: 12\n", "car.yaml: holds more than one YAML document"},
      {"window: [1\n", "is not valid YAML"},
      {"window: 10\n\tname: x\n", "is not valid YAML"},
  };
  for (const Mistake& mistake : mistakes) {
    INFO(mistake.text);
    CHECK_THAT(error_of(mistake.text), Catch::Contains(mistake.error));
  }
}

TEST_CASE("deep nesting is refused before it reaches the stack") {
  CHECK_THAT(error_of(std::string(5000, '[')), Catch::Contains("nested deeper") || Catch::Contains("not valid YAML"));
  std::string maps;
  for (int i = 0; i < 200; ++i) maps += std::string(static_cast<std::size_t>(i), ' ') + "a:\n";
  CHECK_THAT(error_of(maps), Catch::Contains("nested deeper"));
}

struct Strict {
  double length = 0.0;
};

template <class Visitor>
void visit(Strict& c, Visitor& v) {
  v.require("length_s");
  v.number("length_s", c.length, 0.0, 1.0);
}

TEST_CASE("a required key that is missing is an error") {
  CHECK(parse_config<Strict>("length_s: 1\n", "f").length == 1.0);
  CHECK_THROWS_WITH(parse_config<Strict>("", "f"), Catch::Contains("length_s is missing"));
  CHECK_THROWS_WITH(parse_config<Strict>("length_ms: 1\n", "f"),
                    Catch::Contains("f:1: length_ms is unknown, did you mean length_s?"));
}

TEST_CASE("a missing configuration file means defaults only where that is asked for") {
  CHECK(load_config_or_defaults<SampleConfig>("no_such_dir/x.yaml").window == 10);
  CHECK_THROWS_WITH(load_config<SampleConfig>("no_such_dir/x.yaml"),
                    Catch::Contains("no_such_dir/x.yaml: no such file"));
}

}  // namespace
}  // namespace roadfix
