#include "config/calibration.h"

#include <cmath>

#include "config/config.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

// Ranges are those of anything that could sit in a road vehicle; they catch a wrong unit or a slipped comma.
constexpr double kMaxRate = 10000.0;  // Hz
constexpr double kMaxLength = 50.0;   // m, of a lever arm
constexpr double kMaxSeconds = 10.0;  // s, of a latency or an offset
constexpr double kMaxPixels = 20000.0;

// Standard deviations of a place seen from the IMU: about as far as it may be, and what a tape measure leaves.
const Eigen::Vector3d kUnknownAxle_m(1.0, 0.5, 0.5);
const Eigen::Vector3d kUnknownAntenna_m(1.0, 0.5, 1.0);
constexpr double kDefaultLeverArmStd_m = 0.05;

}  // namespace

template <class Visitor>
void visit(ImuCalibration& c, Visitor& v) {
  v.optional_number("rate_hz", c.rate, 0.1, kMaxRate);
  v.optional_number("gyro_noise_radps_per_rthz", c.gyro_noise, 0.0, 1.0);
  v.optional_number("accel_noise_mps2_per_rthz", c.accel_noise, 0.0, 10.0);
  v.optional_number("gyro_bias_std_radps", c.gyro_bias_std, 0.0, 10.0);
  v.optional_number("accel_bias_std_mps2", c.accel_bias_std, 0.0, 100.0);
  v.optional_number("scale_std", c.scale_std, 0.0, 1.0);
  v.optional_number("correlation_s", c.correlation, 1e-3, kLongestCorrelation_s);
  v.optional_number("accel_correlation_s", c.accel_correlation, 1e-3, kLongestCorrelation_s);
  v.optional_number("time_offset_std_s", c.time_offset_std, 0.0, kMaxSeconds);
}

template <class Visitor>
void visit(GnssCalibration& c, Visitor& v) {
  v.optional_number("rate_hz", c.rate, 0.001, kMaxRate);
  v.optional_vector("lever_arm_body_m", c.lever_arm, -kMaxLength, kMaxLength);
  v.optional_number("lever_arm_std_m", c.lever_arm_std, 0.0, kMaxLength);
  v.optional_choice(
      "height", c.height,
      {{"ellipsoid", HeightKind::kEllipsoid}, {"msl", HeightKind::kMeanSeaLevel}, {"unknown", HeightKind::kUnknown}});
  v.optional_number("position_latency_std_s", c.position_latency_std, 0.0, kMaxSeconds);
  v.optional_number("velocity_latency_std_s", c.velocity_latency_std, 0.0, kMaxSeconds);
}

template <class Visitor>
void visit(WheelsCalibration& c, Visitor& v) {
  v.optional_number("rate_hz", c.rate, 0.01, kMaxRate);
  v.optional_number("speed_scale_std", c.speed_scale_std, 0.0, 1.0);
  v.optional_number("speed_noise_mps", c.speed_noise, 0.0, 10.0);
  v.optional_number("yaw_rate_noise_radps", c.yaw_rate_noise, 0.0, 1.0);
  v.optional_number("yaw_rate_bias_std_radps", c.yaw_rate_bias_std, 0.0, 1.0);
  v.optional_number("latency_std_s", c.latency_std, 0.0, kMaxSeconds);
  v.optional_number("track_width_m", c.track_width, 0.1, 10.0);
  v.optional_vector("lever_arm_body_m", c.lever_arm, -kMaxLength, kMaxLength);
  v.optional_number("lever_arm_std_m", c.lever_arm_std, 0.0, kMaxLength);
  v.optional_number("ticks_per_turn", c.ticks_per_turn, 1e-3, 1e7);
  v.optional_number("wheel_radius_m", c.wheel_radius, 0.01, 5.0);
  v.optional_integer("ticks_wrap_at", c.ticks_wrap_at, 2, int64_t{1} << 53U);
}

template <class Visitor>
void visit(MagCalibration& c, Visitor& v) {
  v.optional_number("declination_deg", c.declination_deg, -180.0, 180.0);
  v.optional_vector("hard_iron_ut", c.hard_iron, -10000.0, 10000.0);
  v.optional_vector("soft_iron", c.soft_iron, -100.0, 100.0);
}

template <class Visitor>
void visit(CameraDistortion& c, Visitor& v) {
  v.choice("model", c.model,
           {{"none", DistortionModel::kNone},
            {"radtan", DistortionModel::kRadtan},
            {"equidistant", DistortionModel::kEquidistant}});
  v.numbers("coefficients", c.coefficients, -1000.0, 1000.0);
  const std::size_t count = c.coefficients.size();
  v.check("coefficients", c.model != DistortionModel::kNone || count == 0, "model none has no coefficients");
  v.check("coefficients", c.model != DistortionModel::kRadtan || count == 4 || count == 5,
          "radtan has 4 or 5 coefficients: k1 k2 p1 p2 [k3]");
  v.check("coefficients", c.model != DistortionModel::kEquidistant || count == 4,
          "equidistant has 4 coefficients: k1 k2 k3 k4");
}

template <class Visitor>
void visit(CameraMounting& c, Visitor& v) {
  v.require("p_m");
  v.vector("p_m", c.p, -kMaxLength, kMaxLength);
  v.require("q_wxyz");
  v.vector("q_wxyz", c.q_wxyz, -1.0, 1.0);
  constexpr double kNormTolerance = 1e-3;  // three digits after the comma, as people write them
  v.check("q_wxyz", std::abs(c.q_wxyz.norm() - 1.0) <= kNormTolerance, "must have unit norm");
  v.optional_number("std_m", c.std, 0.0, kMaxLength);
  v.optional_number("std_deg", c.std_deg, 0.0, 180.0);
}

template <class Visitor>
void visit(CameraCalibration& c, Visitor& v) {
  v.optional_number("rate_hz", c.rate, 0.01, kMaxRate);
  v.optional_integer("width_px", c.width_px, 1, static_cast<int64_t>(kMaxPixels));
  v.optional_integer("height_px", c.height_px, 1, static_cast<int64_t>(kMaxPixels));
  v.optional_choice("model", c.model, {{"pinhole", CameraModel::kPinhole}, {"fisheye", CameraModel::kFisheye}});
  v.optional_vector("intrinsics_px", c.intrinsics_px, -kMaxPixels, kMaxPixels);
  v.check("intrinsics_px", !c.intrinsics_px || c.intrinsics_px->head<2>().minCoeff() > 0.0,
          "fx and fy (of fx fy cx cy) must be positive");
  v.optional_group("distortion", c.distortion);
  v.optional_choice("colour", c.colour, {{"gray", CameraColour::kGray}, {"bgr", CameraColour::kBgr}});
  v.optional_number("time_offset_s", c.time_offset, -kMaxSeconds, kMaxSeconds);
  v.optional_number("time_offset_std_s", c.time_offset_std, 0.0, kMaxSeconds);
  v.optional_number("stamp_jitter_s", c.stamp_jitter, 0.0, kMaxSeconds);
  v.optional_number("focal_std", c.focal_std, 0.0, 0.2);
  v.optional_number("radial_std", c.radial_std, 0.0, 0.5);
  v.optional_group("T_body_camera", c.mounting);
}

template <class Visitor>
void visit(StereoCalibration& c, Visitor& v) {
  v.optional_number("scale_std", c.scale_std, 0.0, 1.0);
  v.optional_number("focal_std", c.focal_std, 0.0, 1.0);
}

template <class Visitor>
void visit(SensorsCalibration& c, Visitor& v) {
  v.optional_group("imu", c.imu);
  v.optional_group("gnss", c.gnss);
  v.optional_group("wheels", c.wheels);
  v.optional_group("mag", c.mag);
  v.optional_group("camera_left", c.camera_left);
  v.optional_group("camera_right", c.camera_right);
  v.optional_group("stereo", c.stereo);
}

template <class Visitor>
void visit(MountingCalibration& c, Visitor& v) {
  v.optional_vector("angles_deg", c.angles_deg, -180.0, 180.0);
  v.optional_vector("std_deg", c.std_deg, 0.0, 180.0);
}

namespace {

template <class Visitor>
void visit_keys(Calibration& c, Visitor& v) {
  v.optional_choice("body_origin", c.body_origin, {{"imu", BodyOrigin::kImu}, {"rear_axle", BodyOrigin::kRearAxle}});
  v.group("sensors", c.sensors);
  v.optional_group("mounting", c.mounting);
}

}  // namespace

void visit(Calibration& c, YamlReader& v) { visit_keys(c, v); }
void visit(Calibration& c, YamlWriter& v) { visit_keys(c, v); }

SE3 CameraMounting::T_body_camera() const {
  return {Eigen::Quaterniond(q_wxyz[0], q_wxyz[1], q_wxyz[2], q_wxyz[3]).normalized(), p};
}

Eigen::Quaterniond Calibration::q_vehicle_body() const {
  if (!mounting || !mounting->angles_deg) return Eigen::Quaterniond::Identity();
  const Eigen::Vector3d angles = kDegree * *mounting->angles_deg;
  return quaternion({angles.z(), angles.y(), angles.x()});
}

Calibration Calibration::in_vehicle_axes() const {
  Calibration c = *this;
  if (!mounting || !mounting->angles_deg) return c;
  const Eigen::Quaterniond turn = q_vehicle_body();
  c.mounting->angles_deg.reset();
  if (c.sensors.gnss && c.sensors.gnss->lever_arm) c.sensors.gnss->lever_arm = turn * *c.sensors.gnss->lever_arm;
  if (c.sensors.wheels && c.sensors.wheels->lever_arm)
    c.sensors.wheels->lever_arm = turn * *c.sensors.wheels->lever_arm;
  for (std::optional<CameraCalibration>* camera : {&c.sensors.camera_left, &c.sensors.camera_right}) {
    if (!*camera || !(*camera)->mounting) continue;
    CameraMounting& m = *(*camera)->mounting;
    const Eigen::Quaterniond q = turn * m.T_body_camera().q;
    m.p = turn * m.p;
    m.q_wxyz << q.w(), q.x(), q.y(), q.z();
  }
  return c;
}

PlaceOnVehicle Calibration::rear_axle() const {
  PlaceOnVehicle place{Eigen::Vector3d::Zero(), kUnknownAxle_m};
  if (body_origin == BodyOrigin::kRearAxle) place.std.setZero();
  if (sensors.wheels && sensors.wheels->lever_arm) {
    place.p = *sensors.wheels->lever_arm;
    place.std.setConstant(sensors.wheels->lever_arm_std.value_or(kDefaultLeverArmStd_m));
  }
  return place;
}

PlaceOnVehicle Calibration::antenna() const {
  PlaceOnVehicle place{Eigen::Vector3d::Zero(), kUnknownAntenna_m};
  if (sensors.gnss && sensors.gnss->lever_arm) {
    place.p = *sensors.gnss->lever_arm;
    place.std.setConstant(sensors.gnss->lever_arm_std.value_or(0.0));
  }
  return place;
}

Calibration load_calibration(const std::filesystem::path& vehicle_dir) {
  return load_config<Calibration>(vehicle_dir / "calibration.yaml");
}

Calibration parse_calibration(const std::string& text, const std::string& file) {
  return parse_config<Calibration>(text, file);
}

std::string calibration_text(const Calibration& calibration) { return config_text(calibration); }

}  // namespace roadfix
