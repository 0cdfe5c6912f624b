#include "gnss_ins_ekf/navigation_stage.h"

#include <roadfix/imu_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/run/publish_slot.h"
#include "bus/sample_codec.h"
#include "bus/track_codec.h"
#include "bus/types/message.h"
#include "config/camera_lens.h"
#include "config/config.h"
#include "geometry/frames.h"
#include "gnss_ins_ekf/handler.h"
#include "gnss_ins_ekf/messages.h"
#include "gnss_ins_ekf/navigation_messages.h"
#include "navigation/navigation.h"
#include "stream/state_bytes.h"

namespace roadfix {

namespace {

constexpr double kMicrotesla = 1e-6;
// s, where the calibration says nothing: fixes stamped when they came out of the receiver are 20 to 100 ms old. Nought
// would claim that they are not, and the delay would pass for a scale or a mounting error.
constexpr double kUnknownLatency = 0.05;
// s, of the IMU's clock against the receiver's, likewise: drivers stamp with the arrival on another computer's clock.
constexpr double kUnknownOffset = 0.05;
// s, likewise of wheel speeds: a control unit filters them and sends them every 10 to 20 ms.
constexpr double kUnknownWheelLatency = 0.03;

// s, likewise of a camera's stamps against the IMU's: kernels stamp pictures when they arrive.
constexpr double kUnknownCameraOffset = 0.03;
constexpr int64_t kTracksLateness_us = 200'000;  // exposure, transport, tracking

enum Input { kImu = 0, kGnss = 1, kWheels = 2, kMag = 3, kStart = 4, kTracks = 5 };
enum Output { kPose = 0, kStatus = 1, kAiding = 2 };

class NavigationStage final : public Stage {
 public:
  NavigationStage(const Calibration& calibration, const GnssInsProcessConfig& config)
      : config_(config),
        calibration_(calibration_text(calibration)),
        pose_slot_(config.publish_period),
        status_slot_(config.status_period) {
    static_cast<navigation::NavigationTuning&>(filter_config_) = config.navigation;
    filter_config_.facts = vehicle_facts(calibration);
    // Without the declination a magnetic heading is not a heading.
    if (!calibration.sensors.mag || !calibration.sensors.mag->declination_deg)
      filter_config_.sources.magnetic_heading = false;
    filter_.emplace(filter_config_);
    spec_.name = "gnss_ins_ekf";
    spec_.inputs = {{"IMU", "imu_t", 0, 0},
                    {"GNSS", "gnss_t", 250'000, 0},
                    {"WHEELS", "wheels_t", 50'000, 0},
                    {"MAG", "mag_t", 50'000, 0},
                    {"START_GNSS_INS_EKF", "state_t", 0, 0}};
    if (filter_config_.sources.camera && filter_config_.facts.camera)
      spec_.inputs.push_back({"VO_FEATURES", "vo_features2_t", kTracksLateness_us, 0});
    spec_.state_layout = 20;
    // A car without an IMU is driven by its wheels.
    spec_.clocks = {{kImu, 200'000}, {kWheels, 500'000}};
    spec_.outputs = {{"POSE_INS", "pose_t"}, {"INS_STATUS", "ins_status_t"}, {"AIDING_INS", "aiding_t"}};
  }

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }

  void apply(const Message& m) override {
    switch (m.input) {
      case kImu:
        (void)filter_->advance(imu_sample(decode<imu_t>(m.bytes)));
        break;
      case kGnss:
        filter_->add(gnss_fix(decode<gnss_t>(m.bytes)), m.seq);
        break;
      case kStart:
        recall(decode<state_t>(m.bytes).state);
        break;
      case kWheels:
        filter_->add(wheel_sample(decode<wheels_t>(m.bytes)), m.seq);
        break;
      case kTracks:
        filter_->add(track_picture(decode<vo_features2_t>(m.bytes)), m.seq);
        break;
      default:
        filter_->add(mag_sample(decode<mag_t>(m.bytes)), m.seq);
        break;
    }
  }

  void on_clock(const Message& m) override {
    if (m.input == kImu) (void)filter_->see(imu_sample(decode<imu_t>(m.bytes)));
    if (m.input == kWheels) (void)filter_->see(wheel_sample(decode<wheels_t>(m.bytes)));
    waits_for_imu_ = m.input != kImu && filter_->has_imu();
  }

  void publish(int64_t now_utime, Outputs& outputs) override {
    if (waits_for_imu_) return;
    for (const navigation::AidingRecord& record : filter_->records()) {
      aiding_t message = aiding(record);
      outputs.publish(kAiding, message);
    }
    filter_->clear_records();
    if (pose_slot_.due(now_utime)) {
      pose_t pose{};
      fill_ins_pose(output_of(now_utime), filter_->anchor(), pose);
      outputs.publish(kPose, pose);
    }
    if (status_slot_.due(now_utime)) {
      ins_status_t status = ins_status(filter_->status(), filter_->filter(), filter_config_.facts);
      outputs.publish(kStatus, status);
    }
  }

  void digest(Digest& digest) const override {
    if (const navigation::Filter* filter = filter_->filter()) filter->digest(digest);
  }

  [[nodiscard]] std::vector<uint8_t> save() const override {
    StateWriter writer;
    writer.put(pose_slot_.last());
    writer.put(status_slot_.last());
    const std::vector<uint8_t> filter = filter_->save();
    writer.put(std::span<const uint8_t>(filter));
    return writer.take();
  }

  void load(std::span<const uint8_t> state) override {
    StateReader reader(state);
    const auto pose_last = reader.get<int64_t>();
    const auto status_last = reader.get<int64_t>();
    std::vector<uint8_t> filter;
    reader.get(filter);
    reader.finish();
    filter_->load(filter);
    pose_slot_.set_last(pose_last);
    status_slot_.set_last(status_last);
  }

  [[nodiscard]] std::vector<uint8_t> memory() const override {
    std::optional<navigation::Memory> memory = filter_->memory();
    return memory ? bytes_of(*memory) : std::vector<uint8_t>();
  }

  [[nodiscard]] std::string effective_config() const override { return config_text(config_); }
  [[nodiscard]] std::string explained_config() const override { return explained_config_text(config_); }
  [[nodiscard]] std::string effective_calibration() const override { return calibration_; }

 private:
  /// Where the newest samples were refused (no numbers, beyond any car), the state is of an earlier time: it must not
  /// go out under this stamp as if it were new.
  navigation::NavigationOutput output_of(int64_t now_utime) {
    navigation::NavigationOutput output = filter_->output();
    if (output.odometry.t_us >= now_utime || output.odometry.validity == Validity::kInvalid) return output;
    output.odometry.validity = Validity::kInvalid;
    output.reason = "the newest samples are unusable";
    return output;
  }

  static std::vector<uint8_t> bytes_of(navigation::Memory& memory) {
    StateArchiveOut out;
    memory.serialise(out);
    return out.out.take();
  }

  void recall(const std::vector<uint8_t>& bytes) {
    navigation::Memory memory;
    if (bytes.size() != bytes_of(memory).size()) return;  // written by another version
    StateArchiveIn in{StateReader(bytes)};
    memory.serialise(in);
    filter_->recall(memory);
  }

  GnssInsProcessConfig config_;
  std::string calibration_;
  navigation::NavigationConfig filter_config_;
  StageSpec spec_;
  std::optional<navigation::Navigation> filter_;
  PublishSlot pose_slot_, status_slot_;
  bool waits_for_imu_ = false;  // this tick came from another clock
};

}  // namespace

std::optional<navigation::CameraFacts> camera_facts(const Calibration& calibration) {
  const SensorsCalibration& sensors = calibration.sensors;
  if (!sensors.camera_left || !sensors.camera_left->intrinsics_px || !sensors.camera_left->mounting) return {};
  const CameraCalibration& left = *sensors.camera_left;
  navigation::CameraFacts c;
  c.left = camera_intrinsics(left, "camera_left");
  c.T_imu_camera = T_body_camera(left, "camera_left");
  take_known(left.mounting->std, c.place_std);
  if (left.mounting->std_deg) c.turn_std = *left.mounting->std_deg * kDegree;
  take_known(left.time_offset, c.offset);
  c.offset_std = left.time_offset_std.value_or(kUnknownCameraOffset);
  take_known(left.stamp_jitter, c.stamp_jitter);
  take_known(left.rate, c.rate);
  if (sensors.camera_right) {
    c.right = camera_intrinsics(*sensors.camera_right, "camera_right");
    c.T_left_right = c.T_imu_camera.inverse() * T_body_camera(*sensors.camera_right, "camera_right");
  }
  return c;
}

navigation::VehicleFacts vehicle_facts(const Calibration& calibration) {
  navigation::VehicleFacts v;
  v.camera = camera_facts(calibration);
  v.position_latency_std = v.velocity_latency_std = kUnknownLatency;
  if (const auto& imu = calibration.sensors.imu) {
    take_known(imu->gyro_noise, v.imu.gyro);
    take_known(imu->accel_noise, v.imu.accel);
    take_known(imu->gyro_bias_std, v.gyro_bias_std);
    take_known(imu->accel_bias_std, v.accel_bias_std);
    take_known(imu->scale_std, v.scale_std);
    take_known(imu->correlation, v.correlation_s);
  }
  if (const auto& gnss = calibration.sensors.gnss) {
    take_known(gnss->position_latency_std, v.position_latency_std);
    // One receiver, one way through it, unless the calibration knows better.
    v.velocity_latency_std = gnss->velocity_latency_std.value_or(v.position_latency_std);
  }
  // The latency's uncertainty is between the two clocks already; where none is given the IMU's defines time.
  const bool latency_told = calibration.sensors.gnss && calibration.sensors.gnss->position_latency_std;
  const std::optional<double> offset_told =
      calibration.sensors.imu ? calibration.sensors.imu->time_offset_std : std::nullopt;
  v.time_offset_std = offset_told.value_or(latency_told ? kUnknownOffset : 0.0);
  if (const auto& wheels = calibration.sensors.wheels) {
    take_known(wheels->speed_scale_std, v.wheel_scale_std);
    take_known(wheels->speed_noise, v.wheels.speed_noise);
    v.wheel_latency_std = wheels->latency_std.value_or(kUnknownWheelLatency);
    take_known(wheels->track_width, v.wheels.track_width);
    take_known(wheels->yaw_rate_noise, v.wheels.yaw_rate_noise);
    take_known(wheels->yaw_rate_bias_std, v.wheels.yaw_rate_bias);
  }
  const PlaceOnVehicle antenna = calibration.antenna(), axle = calibration.rear_axle();
  v.p_imu_antenna = antenna.p;
  v.p_imu_antenna_std = antenna.std;
  v.p_imu_axle = axle.p;
  v.p_imu_axle_std = axle.std;
  if (const auto& mag = calibration.sensors.mag) {
    if (mag->declination_deg) v.magnetic_declination = *mag->declination_deg * kDegree;
    if (mag->hard_iron) v.hard_iron = kMicrotesla * *mag->hard_iron;
    take_known(mag->soft_iron, v.soft_iron);
  }
  v.mounting = calibration.turn_to_forward();
  if (calibration.mounting && calibration.mounting->std_deg) v.mounting_std = kDegree * *calibration.mounting->std_deg;
  return v;
}

std::unique_ptr<Stage> make_navigation_stage(const Calibration& calibration, const GnssInsProcessConfig& config) {
  return std::make_unique<NavigationStage>(calibration, config);
}

}  // namespace roadfix
