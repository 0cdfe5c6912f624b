#include "roadfix/simulate/simulated_log.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <roadfix/config_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>

#include "bus/log/log_reader.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "roadfix/simulate/scenario_file.h"
#include "simulation/scenarios.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string write(const SimulatedDrive& drive, const std::filesystem::path& path) {
  InlineExecutor executor;
  return write_simulated_log(drive, path, {executor});
}

ScenarioConfig demo_without_camera() {
  ScenarioConfig config = scenario("demo");
  config.camera.layout = CameraLayout::kNone;
  return config;
}

SimulatedDrive short_drive(const std::string& fault = "") {
  ScenarioConfig config = demo_without_camera();
  config.duration_s = 70.0;
  if (!fault.empty()) config.faults.push_back(parse_fault(fault));
  return simulate(config, 5);
}

template <class Message>
std::vector<Message> messages(const std::filesystem::path& path, const std::string& channel) {
  std::vector<Message> out;
  LogReader reader(path);
  while (const auto event = reader.next()) {
    if (event->channel == channel) out.push_back(decode<Message>(event->data));
  }
  return out;
}

TEST_CASE("the same drive gives the same bytes, another seed others") {
  const test::TemporaryFolder folder;
  write(short_drive(), folder / "a.lcm");
  write(short_drive(), folder / "b.lcm");
  ScenarioConfig config = demo_without_camera();
  config.duration_s = 70.0;
  write(simulate(config, 6), folder / "c.lcm");
  CHECK(bytes_of(folder / "a.lcm") == bytes_of(folder / "b.lcm"));
  CHECK(bytes_of(folder / "a.lcm") != bytes_of(folder / "c.lcm"));
}

TEST_CASE("every scenario gives the same bytes again, pictures included, and others from another seed") {
  const test::TemporaryFolder folder;
  for (const std::string& name : scenario_names()) {
    CAPTURE(name);
    ScenarioConfig config = scenario(name);
    config.duration_s = 6.0;
    config.camera = with_size(config.camera, 96, 48);
    config.camera.layout = CameraLayout::kMono;
    config.camera.rate_hz = 1.0;
    const auto bytes = [&](std::uint64_t seed) {
      write(simulate(config, seed), folder / "drive.lcm");
      return bytes_of(folder / "drive.lcm");
    };
    const std::string once = bytes(4);
    CHECK(once.size() > 100'000);
    CHECK((once == bytes(4)));
    CHECK((once != bytes(5)));
  }
}

TEST_CASE("the log lies in order of arrival, its messages carry their own time") {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "drive.lcm";
  const SimulatedDrive drive = short_drive("imu.delay@10+5:jitter_s=0.05");
  write(drive, path);
  LogReader reader(path);
  std::int64_t newest = 0;
  std::int64_t newest_imu = 0;
  int out_of_order = 0;
  std::size_t imu = 0;
  bool first = true;
  while (const auto event = reader.next()) {
    CHECK((first == (event->channel == "CONFIG_DRIVE")));
    first = false;
    CHECK(event->timestamp_us >= newest);
    newest = event->timestamp_us;
    if (event->channel != "IMU") continue;
    const std::int64_t utime = decode<imu_t>(event->data).utime;
    out_of_order += utime < newest_imu ? 1 : 0;
    newest_imu = std::max(newest_imu, utime);
    ++imu;
  }
  CHECK(reader.damage().empty());
  CHECK(imu == drive.imu.size());
  CHECK(out_of_order > 20);
}

TEST_CASE("REFERENCE is the truth at the imu") {
  const test::TemporaryFolder folder;
  ScenarioConfig config = scenario("city_loop");
  config.duration_s = 60.0;
  config.imu.position_m = {1.0, 0.2, 0.5};
  const SimulatedDrive drive = simulate(config, 5);
  write(drive, folder / "drive.lcm");
  const auto reference = messages<pose_t>(folder / "drive.lcm", "REFERENCE");
  REQUIRE(reference.size() == 601);
  for (const pose_t& pose : reference) {
    const Odometry truth = drive.truth_at(pose.utime);
    const Eigen::Vector3d p = truth.T_frame_vehicle * config.imu.position_m;
    const Eigen::Vector3d v = truth.velocity + truth.angular_rate.cross(config.imu.position_m);
    REQUIRE((p - Eigen::Map<const Eigen::Vector3d>(pose.position_m)).norm() < 1e-12);
    REQUIRE((v - Eigen::Map<const Eigen::Vector3d>(pose.velocity_mps)).norm() < 1e-12);
    REQUIRE((truth.angular_rate - Eigen::Map<const Eigen::Vector3d>(pose.angular_rate_radps)).norm() < 1e-12);
    REQUIRE(std::abs(truth.T_frame_vehicle.q.coeffs().dot(
                Eigen::Vector4d(pose.q_wxyz[1], pose.q_wxyz[2], pose.q_wxyz[3], pose.q_wxyz[0]))) > 1.0 - 1e-12);
    REQUIRE(pose.validity == pose_t::VALIDITY_VALID);
  }
}

// Exact sensors, so each of them tells how the imu truly sits.
TEST_CASE("REFERENCE and lever arm are in the axes of an imu that sits askew") {
  const test::TemporaryFolder folder;
  ScenarioConfig config = scenario("city_loop");
  config.duration_s = 60.0;
  config.imu.position_m = {1.0, 0.2, 0.5};
  config.imu.mounting_std_rad = {0.09, 0.09, 0.09};
  config.imu.gyro_noise_radps_per_rthz = config.imu.gyro_bias_std_radps = config.imu.gyro_bias_drift_std_radps = 0.0;
  config.imu.gyro_scale_std = config.gnss.sigma_horizontal_m = config.gnss.sigma_up_m = 0.0;
  const SimulatedDrive drive = simulate(config, 5);
  REQUIRE(drive.errors.q_vehicle_imu.vec().norm() > 0.02);
  write(drive, folder / "drive.lcm");
  std::map<std::int64_t, pose_t> reference;
  for (const pose_t& pose : messages<pose_t>(folder / "drive.lcm", "REFERENCE")) reference[pose.utime] = pose;
  double turning = 0.0;
  for (const ImuSample& sample : drive.imu) {
    const auto pose = reference.find(sample.t_us);
    if (pose == reference.end()) continue;
    const Eigen::Map<const Eigen::Vector3d> rate(pose->second.angular_rate_radps);
    turning = std::max(turning, rate.norm());
    REQUIRE((sample.gyro - rate).norm() < 0.006);  // a mean over 10 ms, and the Earth's rate
  }
  CHECK(turning > 0.3);
  const Eigen::Vector3d lever = *calibration_of(drive).sensors.gnss->lever_arm;
  int fixes = 0;
  for (const GnssFix& fix : drive.gnss) {
    const auto found = reference.find(fix.t_us);
    if (found == reference.end()) continue;
    const pose_t& pose = found->second;
    const Eigen::Quaterniond q(pose.q_wxyz[0], pose.q_wxyz[1], pose.q_wxyz[2], pose.q_wxyz[3]);
    const Eigen::Vector3d antenna = q * lever + Eigen::Map<const Eigen::Vector3d>(pose.position_m);
    REQUIRE((antenna - drive.anchor.enu(fix.antenna)).norm() < 1e-6);
    const Eigen::Vector3d velocity = q * Eigen::Map<const Eigen::Vector3d>(pose.velocity_mps);
    const Odometry truth = drive.truth_at(fix.t_us);
    const Eigen::Vector3d in_vehicle = truth.velocity + truth.angular_rate.cross(config.imu.position_m);
    REQUIRE((velocity - truth.T_frame_vehicle.q * in_vehicle).norm() < 1e-9);
    ++fixes;
  }
  CHECK(fixes > 100);
}

TEST_CASE("the silence of the receiver is an outage of the facts") {
  const SimulatedDrive drive = short_drive();
  const DriveFacts facts = facts_of(drive);
  REQUIRE(facts.outages.size() == 1);
  const std::int64_t start = drive.config.start_utime;
  CHECK(facts.outages[0].first_withheld_us - start == 30'000'000);
  CHECK(facts.outages[0].last_withheld_us - start == 59'750'000);
  CHECK(facts.outages[0].return_us - start == 60'000'000);
}

TEST_CASE("CONFIG_DRIVE carries facts, calibration and the scenario with its seed") {
  const test::TemporaryFolder folder;
  const SimulatedDrive drive = short_drive();
  write(drive, folder / "drive.lcm");
  const auto config = messages<config_t>(folder / "drive.lcm", "CONFIG_DRIVE");
  REQUIRE(config.size() == 1);
  CHECK_THAT(config[0].config_yaml, Catch::Matchers::Contains("seed 5"));
  CHECK(parse_config<DriveFacts>(config[0].config_yaml, "facts").outages.size() == 1);
  const Calibration calibration = parse_calibration(config[0].calibration_yaml, "calibration");
  CHECK(calibration.sensors.gnss->lever_arm == drive.config.gnss.lever_arm_m);
  CHECK(calibration.sensors.imu->gyro_noise == drive.config.imu.gyro_noise_radps_per_rthz);
}

TEST_CASE("a scenario as it stands is named, another one spelled out so that it can be made again") {
  const test::TemporaryFolder folder;
  ScenarioConfig config = scenario("corridor");
  config.duration_s = 20.0;
  write(simulate(config, 9), folder / "changed.lcm");
  const std::string changed = messages<config_t>(folder / "changed.lcm", "CONFIG_DRIVE").at(0).config_yaml;
  CHECK_THAT(changed, Catch::Matchers::Contains("duration_s: 20") && Catch::Matchers::Contains("seed 9"));
  write(simulate(scenario("city_loop"), 1), folder / "named.lcm");
  const std::string named = messages<config_t>(folder / "named.lcm", "CONFIG_DRIVE").at(0).config_yaml;
  CHECK_THAT(named, Catch::Matchers::StartsWith("# Simulated: city_loop, seed 1.\n"));
  CHECK_THAT(named, !Catch::Matchers::Contains("gyro_noise"));
}

/// Channel, time and bytes of every event, without the pictures and CONFIG_DRIVE.
std::vector<std::string> events_of(const std::filesystem::path& path) {
  std::vector<std::string> events;
  LogReader reader(path);
  while (const auto e = reader.next()) {
    if (e->channel == "CAMERA_LEFT" || e->channel == "CONFIG_DRIVE") continue;
    events.push_back(std::string(e->channel) + " " + std::to_string(e->timestamp_us) + " " +
                     std::string(e->data.begin(), e->data.end()));
  }
  return events;
}

// The whole command draws for a minute: here, everything but the pictures, and the first of those.
TEST_CASE("logs/demo.lcm and configs/demo are what their command makes") {
  const test::TemporaryFolder folder;
  const std::filesystem::path committed = test::source_path("logs/demo.lcm");
  const ScenarioConfig config = load_scenario("demo");
  CHECK(std::filesystem::file_size(committed) < 25'000'000);
  SimulatedDrive drive = simulate(config, 1);
  CHECK(calibration_text(load_calibration(test::source_path("configs/demo"))) ==
        calibration_text(calibration_of(drive)));
  const auto pictures = messages<image_t>(committed, "CAMERA_LEFT");
  REQUIRE(pictures.size() == drive.pictures_left.size());
  CHECK(pictures.back().utime == drive.pictures_left.back().t_us);
  constexpr std::size_t kFirst = 5;
  drive.pictures_left.resize(kFirst);
  drive.deliveries.camera_left.resize(kFirst);
  write(drive, folder / "demo.lcm");
  const auto first = messages<image_t>(folder / "demo.lcm", "CAMERA_LEFT");
  REQUIRE(first.size() == kFirst);
  for (std::size_t i = 0; i < kFirst; ++i) {
    CHECK(first[i].utime == pictures[i].utime);
    CHECK(first[i].exposure_s == pictures[i].exposure_s);
    CHECK(first[i].data == pictures[i].data);
  }
  CHECK(events_of(folder / "demo.lcm") == events_of(committed));
  // The log is older than the key for the accelerometer's own correlation time.
  const auto told_by = [](const std::filesystem::path& log) { return messages<config_t>(log, "CONFIG_DRIVE").at(0); };
  const config_t now = told_by(folder / "demo.lcm"), then = told_by(committed);
  Calibration calibration = parse_calibration(now.calibration_yaml, "calibration");
  CHECK(calibration.sensors.imu->accel_correlation == Approx(6'000'600.0));
  calibration.sensors.imu->accel_correlation.reset();
  CHECK(calibration_text(calibration) == calibration_text(parse_calibration(then.calibration_yaml, "calibration")));
  CHECK(now.config_yaml == then.config_yaml);
}

}  // namespace
}  // namespace roadfix
