// VO_FEATURES in the stage gnss_ins_ekf: what the calibration says of the camera, what a camera changes that shows nothing,
// is switched off, or sees; and all of it beside an imu that sits askew.
#include <catch2/catch.hpp>
#include <roadfix/aiding_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/ins_status_t.hpp>

#include "bus/run/stage_runner.h"
#include "geometry/frames.h"
#include "gnss_ins_ekf/handler.h"
#include "gnss_ins_ekf/vehicle_facts.h"
#include "simulation/scenarios.h"
#include "support/shared_data.h"
#include "support/track_messages.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

constexpr size_t kFewTracks = 60;  // a picture

struct Published : MessageSink {
  std::vector<pose_t> poses;  ///< without what names the inputs
  std::vector<uint8_t> pose_bytes;
  int camera_used = 0, camera_refused = 0, aided_by = 0;
  std::optional<ins_status_t> first_status;
  ins_status_t status{};  ///< the last one
  void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
    if (channel == "POSE_INS") {
      poses.push_back(decode<pose_t>(bytes));
      poses.back().provenance = {};
      const std::vector<uint8_t> own = encode(poses.back());
      pose_bytes.insert(pose_bytes.end(), own.begin(), own.end());
    } else if (channel == "INS_STATUS") {
      status = decode<ins_status_t>(bytes);
      aided_by |= status.aided_by;
      if (!first_status) first_status = status;
    } else if (channel == "AIDING_INS") {
      const auto record = decode<aiding_t>(bytes);
      if (record.source != aiding_t::SOURCE_CAMERA_TRACKS) return;
      (record.status == aiding_t::STATUS_ACCEPTED ? camera_used : camera_refused) += 1;
    }
  }
};

const std::vector<DriveMessage>& drive() {
  static const std::vector<DriveMessage> kDrive = [] {
    ScenarioConfig config = scenario("demo");
    config.duration_s = 25.0;
    return track_messages(make_track_drive(config, 1, with_noise_of_pictures({})), kFewTracks);
  }();
  return kDrive;
}

enum class Pictures { kAll, kEmpty, kNone };

Published run(const Calibration& calibration, Pictures pictures, bool camera = true,
              const std::vector<DriveMessage>& messages = drive()) {
  GnssInsProcessConfig config;
  config.navigation.sources.camera = camera;
  Published published;
  StageRunner runner(make_gnss_ins_ekf(calibration, config), published);
  const auto& inputs = runner.spec().inputs;
  for (const DriveMessage& m : messages) {
    const auto input =
        std::find_if(inputs.begin(), inputs.end(), [&](const InputSpec& i) { return i.channel == m.channel; });
    if (input == inputs.end()) continue;
    const auto index = static_cast<int>(input - inputs.begin());
    if (m.channel != "VO_FEATURES" || pictures == Pictures::kAll) {
      runner.offer(index, m.bytes);
    } else if (pictures == Pictures::kEmpty) {
      vo_features2_t dark{};
      dark.utime = m.header.utime;
      dark.run = m.header.run;
      dark.seq = m.header.seq;
      runner.offer(index, encode(dark));
    }
  }
  return published;
}

Calibration demo() { return load_calibration(source_path("configs/demo")); }

}  // namespace

TEST_CASE("a camera that sees nothing leaves POSE_INS, bit for bit, what it is without a camera") {
  Calibration blind = demo();
  blind.sensors.camera_left.reset();
  const Published without = run(blind, Pictures::kNone);
  REQUIRE(without.poses.size() > 1000);
  CHECK(run(demo(), Pictures::kEmpty).pose_bytes == without.pose_bytes);
  CHECK(run(demo(), Pictures::kNone).pose_bytes == without.pose_bytes);
  CHECK(run(demo(), Pictures::kAll, false).pose_bytes == without.pose_bytes);
  // The comparison can fail.
  const Published seeing = run(demo(), Pictures::kAll);
  CHECK(seeing.pose_bytes != without.pose_bytes);
  CHECK(seeing.camera_used > 20);
  CHECK((seeing.aided_by & ins_status_t::AIDED_CAMERA_TRACKS) != 0);
  CHECK(without.camera_used + without.camera_refused == 0);
  CHECK((without.aided_by & ins_status_t::AIDED_CAMERA_TRACKS) == 0);
}

namespace {

/// The same drive with the imu, and what is measured from it, in axes of its own: front, right, down, and askew.
struct Turned {
  const Eigen::Vector3d angles_deg{180.0, 5.0, -20.0};
  Calibration calibration = demo();
  std::vector<DriveMessage> messages = drive();

  Turned() {
    calibration.mounting = MountingCalibration{angles_deg, calibration.mounting->std_deg};
    const Eigen::Quaterniond to_body = calibration.q_vehicle_body().conjugate();
    auto& sensors = calibration.sensors;
    sensors.gnss->lever_arm = to_body * *sensors.gnss->lever_arm;
    if (sensors.wheels->lever_arm) sensors.wheels->lever_arm = to_body * *sensors.wheels->lever_arm;
    CameraMounting& camera = *sensors.camera_left->mounting;
    const Eigen::Quaterniond q = to_body * camera.T_body_camera().q;
    camera.p = to_body * camera.p;
    camera.q_wxyz << q.w(), q.x(), q.y(), q.z();
    for (DriveMessage& m : messages) {
      if (m.channel != "IMU") continue;
      imu_t imu = decode<imu_t>(m.bytes);
      const ImuSample sample = in_axes(to_body, imu_sample(imu));
      for (int i = 0; i < 3; ++i) imu.gyro_radps[i] = sample.gyro(i), imu.accel_mps2[i] = sample.accel(i);
      m.bytes = encode(imu);
    }
  }
};

double largest_difference(const std::vector<pose_t>& a, const std::vector<pose_t>& b) {
  double largest = 0.0;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    for (int k = 0; k < 3; ++k) largest = std::max(largest, std::abs(a[i].position_m[k] - b[i].position_m[k]));
    for (int k = 0; k < 4; ++k) largest = std::max(largest, std::abs(a[i].q_wxyz[k] - b[i].q_wxyz[k]));
    for (int k = 0; k < 3; ++k) largest = std::max(largest, std::abs(a[i].velocity_mps[k] - b[i].velocity_mps[k]));
  }
  return largest;
}

}  // namespace

TEST_CASE("an imu that hangs upside down and askew gives the vehicle's pose, as one that stands upright") {
  const Published upright = run(demo(), Pictures::kAll);
  Turned turned;
  const Published same = run(turned.calibration, Pictures::kAll, true, turned.messages);
  REQUIRE(same.poses.size() == upright.poses.size());
  CHECK(largest_difference(upright.poses, same.poses) < 1e-3);
  for (const ins_status_t& status : {*same.first_status, same.status})  // before there is a filter, too
    for (int i = 0; i < 3; ++i) CHECK(status.mounting_rad[i] / kDegree == Approx(turned.angles_deg(i)).margin(1e-6));
  // Teeth: angles that are not told.
  turned.calibration.mounting->angles_deg.reset();
  CHECK(largest_difference(upright.poses, run(turned.calibration, Pictures::kAll, true, turned.messages).poses) > 0.1);
}

TEST_CASE("the stage asks for VO_FEATURES where there is a camera that it may use") {
  const auto asks = [](const Calibration& calibration, bool camera) {
    GnssInsProcessConfig config;
    config.navigation.sources.camera = camera;
    const auto stage = make_gnss_ins_ekf(calibration, config);
    const auto& inputs = stage->spec().inputs;
    return std::any_of(inputs.begin(), inputs.end(), [](const InputSpec& i) { return i.channel == "VO_FEATURES"; });
  };
  CHECK(asks(demo(), true));
  CHECK_FALSE(asks(demo(), false));
  Calibration c = demo();
  c.sensors.camera_left->mounting.reset();
  CHECK_FALSE(asks(c, true));
}

TEST_CASE("what a calibration says of a camera") {
  Calibration c = demo();
  CHECK(camera_facts(c)->offset_std == 0.0);
  c.sensors.camera_left->time_offset_std.reset();
  CHECK(camera_facts(c)->offset_std == 0.03);  // a camera whose clock nobody compared is not exact
  c.sensors.camera_left->time_offset = -0.02;
  CHECK(camera_facts(c)->offset == -0.02);
  CHECK(camera_facts(c)->radial_std == navigation::CameraFacts().radial_std);
  c.sensors.camera_left->focal_std = 0.02;
  c.sensors.camera_left->radial_std = 0.1;
  CHECK(camera_facts(c)->focal_std == 0.02);
  CHECK(camera_facts(c)->radial_std == 0.1);
  CHECK(camera_facts(c)->radial4_std == 0.2);
  CHECK_FALSE(camera_facts(c)->right);
  c.sensors.camera_right = c.sensors.camera_left;
  c.sensors.camera_right->mounting->p.y() -= 0.54;
  const auto stereo = camera_facts(c);
  REQUIRE(stereo->right);
  CHECK((stereo->T_left_right.p - Eigen::Vector3d(0.54, 0.0, 0.0)).norm() < 0.02);
  c.sensors.camera_right->intrinsics_px.reset();
  CHECK_THROWS_WITH(camera_facts(c), Catch::Contains("camera_right.intrinsics_px"));
}
