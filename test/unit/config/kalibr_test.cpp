// A camera chain as Kalibr writes it becomes the calibration that it means.
#include "config/kalibr.h"

#include <catch2/catch.hpp>

#include "config/config_error.h"

namespace roadfix {
namespace {

// The keys and their order are those of the example in Kalibr's wiki. The first camera looks ahead, from 1.2 m before,
// 0.3 m left of and 0.9 m above the imu; the second one is 0.54 m to its right.
const std::string kChain = R"(cam0:
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.3]
  - [0.0, 0.0, -1.0, 0.9]
  - [1.0, 0.0, 0.0, -1.2]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2834, 0.0739, 0.00019, 1.8e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.0125
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.54]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [0.0034, 0.00076, -0.002, 0.0004]
  distortion_model: equidistant
  intrinsics: [457.5, 456.1, 379.9, 255.2]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return text;
}

TEST_CASE("Kalibr's chain gives lenses, places and the time offset as they are meant") {
  const KalibrCameras found = parse_kalibr(kChain, "chain");
  CHECK(*found.left.intrinsics_px == Eigen::Vector4d(458.654, 457.296, 367.215, 248.375));
  CHECK(found.left.distortion->model == DistortionModel::kRadtan);
  CHECK(found.left.distortion->coefficients == std::vector<double>{-0.2834, 0.0739, 0.00019, 1.8e-05});
  CHECK(*found.left.width_px == 752);
  CHECK(*found.left.height_px == 480);
  CHECK(*found.left.time_offset == 0.0125);  // imu time = stamp + this, in both
  const SE3 T_body_left = found.left.mounting->T_body_camera();
  CHECK((T_body_left.p - Eigen::Vector3d(1.2, 0.3, 0.9)).norm() < 1e-12);
  // What lies 5 m before the camera, 1 m to its right and 2 m below it.
  CHECK((T_body_left * Eigen::Vector3d(1.0, 2.0, 5.0) - Eigen::Vector3d(6.2, -0.7, -1.1)).norm() < 1e-12);
  REQUIRE(found.right);
  CHECK(found.right->distortion->model == DistortionModel::kEquidistant);
  const SE3 T_left_right = T_body_left.inverse() * found.right->mounting->T_body_camera();
  CHECK((T_left_right.p - Eigen::Vector3d(0.54, 0.0, 0.0)).norm() < 1e-12);
  CHECK_FALSE(found.right->time_offset);
}

TEST_CASE("of two cameras the one to the right is the right one, whichever comes first") {
  const KalibrCameras found = parse_kalibr(replaced(kChain, "0.0, -0.54]", "0.0, 0.54]"), "chain");
  REQUIRE(found.right);
  CHECK(found.right->intrinsics_px->x() == 458.654);
  CHECK(found.left.mounting->T_body_camera().p.y() == Approx(0.84));
}

TEST_CASE("what Kalibr does not know stays in the calibration") {
  Calibration c = parse_calibration(
      "sensors: {camera_left: {rate_hz: 20, colour: gray, width_px: 10, time_offset_std_s: 0.02, "
      "T_body_camera: {p_m: [0, 0, 0], q_wxyz: [1, 0, 0, 0], std_m: 0.1, std_deg: 3}}, gnss: {rate_hz: 5}}",
      "calibration");
  take_kalibr(parse_kalibr(kChain, "chain"), c);
  const Calibration read = parse_calibration(calibration_text(c), "again");
  const CameraCalibration& left = *read.sensors.camera_left;
  CHECK(*left.rate == 20.0);
  CHECK(*left.colour == CameraColour::kGray);
  CHECK(*left.width_px == 752);
  CHECK(*left.time_offset_std == 0.02);
  CHECK(*left.mounting->std_deg == 3.0);
  CHECK(left.mounting->p.x() == Approx(1.2));
  CHECK(*read.sensors.gnss->rate == 5.0);
  CHECK(read.sensors.camera_right->intrinsics_px->x() == 457.5);
}

TEST_CASE("a chain that cannot be taken is refused with its line") {
  const auto error = [](const std::string& text) -> std::string {
    try {
      (void)parse_kalibr(text, "chain.yaml");
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "";
  };
  using Catch::Matchers::Contains;
  CHECK_THAT(error(replaced(kChain, "camera_model: pinhole", "camera_model: omni")),
             Contains("chain.yaml:8") && Contains("pinhole"));
  CHECK_THAT(error(replaced(kChain, "radtan", "fov")), Contains("distortion_model"));
  CHECK_THAT(error(replaced(kChain, "[0.0, -1.0, 0.0, 0.3]", "[0.0, -2.0, 0.0, 0.3]")), Contains("T_cam_imu"));
  CHECK_THAT(error(replaced(kChain, "resolution: [752, 480]", "resolution: [752]")), Contains("resolution"));
  CHECK_THAT(error(kChain + "cam2:\n  camera_model: pinhole\n"), Contains("cam2"));
}

}  // namespace
}  // namespace roadfix
