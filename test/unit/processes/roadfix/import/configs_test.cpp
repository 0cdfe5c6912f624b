// The vehicles under configs/ are such that every program reads them.
#include <catch2/catch.hpp>
#include <set>

#include "config/calibration.h"
#include "config/config_error.h"
#include "roadfix/stages.h"
#include "roadfix/vehicle_defaults.h"
#include "small_drive.h"
#include "support/shared_data.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

TEST_CASE("every vehicle under configs can be loaded") {
  std::set<fs::path> vehicles;
  for (const auto& entry : fs::directory_iterator(test::source_path("configs"))) {
    if (entry.is_directory() && entry.path().filename() != "systemd") vehicles.insert(entry.path());
  }
  CHECK(vehicles.size() >= 2);
  for (const fs::path& vehicle : vehicles) {
    INFO(vehicle.string());
    CHECK_NOTHROW(load_calibration(vehicle));
    for (const std::string& stage : stage_names()) {
      if (fs::exists(vehicle / (stage + ".yaml"))) CHECK_NOTHROW(make_stages({stage}, vehicle));
    }
  }
}

TEST_CASE("the example knows every key of a calibration") {
  const Calibration c = load_calibration(test::source_path("configs/example"));
  const auto& s = c.sensors;
  CHECK((s.imu && s.gnss && s.wheels && s.mag && s.camera_left));
  CHECK((s.imu->rate && s.imu->gyro_noise && s.imu->accel_noise && s.imu->gyro_bias_std && s.imu->accel_bias_std));
  CHECK((s.imu->scale_std && s.imu->correlation && s.imu->time_offset_std));
  CHECK((s.gnss->lever_arm && s.gnss->height && s.gnss->position_latency_std && s.gnss->velocity_latency_std));
  CHECK((s.wheels->speed_scale_std && s.wheels->speed_noise && s.wheels->track_width));
  CHECK((s.mag->declination_deg && s.mag->hard_iron && s.mag->soft_iron));
  CHECK((s.camera_left->distortion && s.camera_left->mounting && s.camera_left->stamp_jitter));
}

TEST_CASE("written defaults change nothing and can be switched on line by line") {
  const test::TemporaryFolder folder;
  test::write_file(folder / "calibration.yaml", "body_origin: imu\nsensors: {imu: {rate_hz: 100}}\n");
  write_process_defaults(folder.path());
  const std::string stage = "gnss_ins_ekf";
  const std::string before = make_stages({stage}, folder.path()).front()->effective_config();
  std::string text = test::read_file(folder / (stage + ".yaml"));
  std::string uncommented;
  for (std::size_t at = text.find('\n') + 1; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    CHECK(text.substr(at, 2) == "# ");
    uncommented += text.substr(at + 2, end - at - 1);
    at = end + 1;
  }
  CHECK(uncommented == make_stages({stage}, folder.path()).front()->explained_config());
  test::write_file(folder / (stage + ".yaml"), uncommented);
  CHECK(make_stages({stage}, folder.path()).front()->effective_config() == before);
  const std::string changed = "publish_period_s: 0.5\n";
  test::write_file(folder / (stage + ".yaml"), changed);
  write_process_defaults(folder.path());  // an existing file is somebody's work
  CHECK(test::read_file(folder / (stage + ".yaml")) == changed);
  test::write_file(folder / (stage + ".yaml"), "publish_period_ms: 5\n");
  CHECK_THROWS_WITH(make_stages({stage}, folder.path()), Catch::Contains("did you mean publish_period_s?"));
}

TEST_CASE("a vehicle without a camera is not told that the visual stage lacks one") {
  const test::TemporaryFolder folder;
  test::write_file(folder / "calibration.yaml", "body_origin: imu\nsensors: {imu: {rate_hz: 100}}\n");
  CHECK(write_process_defaults(folder.path()).empty());
  CHECK(std::filesystem::exists(folder / "wheel_odometry.yaml"));
  CHECK_FALSE(std::filesystem::exists(folder / "vo_tracker.yaml"));
  // One whose camera has no lens is.
  const std::string with_camera = "body_origin: imu\nsensors: {imu: {rate_hz: 100}, camera_left: {rate_hz: 10}}\n";
  test::write_file(folder / "calibration.yaml", with_camera);
  const std::vector<std::string> remarks = write_process_defaults(folder.path());
  REQUIRE(remarks.size() == 1);
  CHECK_THAT(remarks.front(), Catch::StartsWith("vo_tracker: "));
}

}  // namespace
}  // namespace roadfix
