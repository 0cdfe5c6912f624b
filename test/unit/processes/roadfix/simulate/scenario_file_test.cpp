#include "roadfix/simulate/scenario_file.h"

#include <catch2/catch.hpp>
#include <fstream>

#include "config/config_error.h"
#include "simulation/faults.h"
#include "simulation/scenarios.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

using Catch::Matchers::Contains;

std::string saved(const test::TemporaryFolder& folder, const std::string& text) {
  const std::filesystem::path path = folder / "scenario.yaml";
  std::ofstream(path) << text;
  return path.string();
}

TEST_CASE("every scenario survives its own YAML") {
  const test::TemporaryFolder folder;
  for (const std::string& name : scenario_names()) {
    const std::string text = scenario_text(scenario(name));
    CHECK(scenario_text(load_scenario(saved(folder, text))) == text);
  }
}

TEST_CASE("a file changes what it names and keeps the rest of its scenario") {
  const test::TemporaryFolder folder;
  const ScenarioConfig config = load_scenario(saved(folder,
                                                    "scenario: tunnel_lit\n"
                                                    "name: mine\n"
                                                    "imu: {rate_hz: 200}\n"
                                                    "faults:\n"
                                                    "  - {kind: gnss.bias, start_s: 4, east_m: 3}\n"));
  CHECK(config.name == "mine");
  CHECK(config.imu.rate_hz == 200.0);
  CHECK(config.motion.route == RouteKind::kTunnel);
  REQUIRE(config.faults.size() == 1);
  CHECK(fault_text(config.faults[0]) == "gnss.bias@4:east_m=3,north_m=0,up_m=0");
}

TEST_CASE("every fault is the same from a file and from the command line") {
  const test::TemporaryFolder folder;
  for (const FaultType& type : fault_types()) {
    CAPTURE(type.name);
    Fault fault(type, 12.5, 3.25);
    std::string yaml = "scenario: highway\nfaults:\n  - {kind: " + type.name + ", start_s: 12.5, duration_s: 3.25";
    for (std::size_t i = 0; i < type.parameters.size(); ++i) {
      const FaultParameter& p = type.parameters[i];
      fault.values[i] = p.min + 0.25 * (p.max - p.min);
      yaml += ", " + std::string(p.key) + ": " + std::to_string(fault.values[i]);
    }
    const ScenarioConfig config = load_scenario(saved(folder, yaml + "}\n"));
    REQUIRE(config.faults.size() == 1);
    const Fault typed = parse_fault(fault_text(config.faults[0]));
    CHECK(fault_text(typed) == fault_text(config.faults[0]));
    CHECK(typed.sensor == type.sensor);
    CHECK(typed.kind == type.kind);
    CHECK(typed.start_s == 12.5);
    CHECK(typed.duration_s == 3.25);
    for (std::size_t i = 0; i < type.parameters.size(); ++i) {
      CAPTURE(type.parameters[i].key);
      CHECK(typed.values[i] == Approx(fault.values[i]).epsilon(1e-5).margin(1e-6));
    }
  }
}

TEST_CASE("what is wrong in a file is named with its line") {
  const test::TemporaryFolder folder;
  const auto error = [&](const std::string& text) -> std::string {
    try {
      load_scenario(saved(folder, text));
    } catch (const std::exception& e) {
      return e.what();
    }
    return "";
  };
  CHECK_THAT(error("scenario: mars\n"), Contains("scenario.yaml:1") && Contains("mars"));
  CHECK_THAT(error("imu: {rate: 200}\n"), Contains("imu.rate"));
  CHECK_THAT(error("faults:\n  - {kind: gnss.nothing}\n"), Contains(":2") && Contains("gnss.nothing"));
  CHECK_THAT(error("faults:\n  - {start_s: 3}\n"), Contains("kind"));
  CHECK_THAT(error("faults:\n  - {kind: gnss.bias, ratio: 3}\n"), Contains("ratio"));
  CHECK_THROWS_WITH(load_scenario("no_such"), Contains("city_loop"));
  CHECK_THROWS_WITH(load_scenario("no_such.yaml"), Contains("no_such.yaml"));
}

}  // namespace
}  // namespace roadfix
