#include "wheel_odometry/handler.h"

#include <cmath>
#include <deque>
#include <roadfix/imu_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/wheels_t.hpp>
#include <variant>

#include "bus/run/publish_slot.h"
#include "bus/sample_codec.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "geometry/frames.h"

namespace roadfix {
namespace {

enum Input { kImu = 0, kWheels = 1, kMag = 2, kStart = 3 };
using Sample = std::variant<ImuSample, WheelSample, MagSample>;

Sample sample_of(const Message& message, const Eigen::Quaterniond& q_vehicle_body) {
  switch (message.input) {
    case kImu:
      return in_axes(q_vehicle_body, imu_sample(decode<imu_t>(message.bytes)));
    case kWheels:
      return wheel_sample(decode<wheels_t>(message.bytes));
    default:
      return mag_sample(decode<mag_t>(message.bytes));
  }
}

int8_t state_code(WheelPhase phase) {
  switch (phase) {
    case WheelPhase::kWaiting:
      return pose_t::STATE_WAITING;
    case WheelPhase::kAligning:
      return pose_t::STATE_ALIGNING;
    case WheelPhase::kRunning:
      return pose_t::STATE_RUNNING;
    case WheelPhase::kWeak:
      return pose_t::STATE_WEAK;
    case WheelPhase::kLost:
      break;
  }
  return pose_t::STATE_LOST;
}

class WheelOdometryStage final : public Stage {
 public:
  WheelOdometryStage(const Calibration& calibration, const WheelOdometryConfig& config)
      : config_(config),
        calibration_(calibration_text(calibration)),
        q_vehicle_body_(calibration.q_vehicle_body()),
        on_rear_axle_(calibration.body_origin == BodyOrigin::kRearAxle),
        slot_(config.publish_period),
        odometry_({wheel_sensors(calibration), config.odometry}) {
    spec_.name = "wheel_odometry";
    spec_.inputs = {{"IMU", "imu_t", 0, 0},
                    {"WHEELS", "wheels_t", 50'000, 0},
                    {"MAG", "mag_t", 50'000, 0},
                    {"START_WHEEL_ODOMETRY", "state_t", 0, 0}};
    spec_.state_layout = 7;
    spec_.clocks = {{kImu, 200'000}, {kWheels, 500'000}};
    spec_.outputs = {{"POSE_WHEEL", "pose_t"}};
  }

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }

  void apply(const Message& message) override {
    if (message.input == kStart) return restore(decode<state_t>(message.bytes).state);
    while (!pending_.empty() && pending_.front().utime <= message.utime) pending_.pop_front();
    add(odometry_, sample_of(message, q_vehicle_body_));
  }

  void on_clock(const Message& message) override {
    pending_.push_back({message.utime, sample_of(message, q_vehicle_body_)});
  }

  void publish(int64_t now_utime, Outputs& outputs) override {
    if (!slot_.due(now_utime)) return;
    WheelOdometry now = odometry_;
    for (const PendingSample& a : pending_) add(now, a.sample);
    now.extrapolate_to(now_utime);
    const WheelReport report = now.report();
    pose_t pose{};
    fill_pose(now.odometry(), pose);
    pose.frame = pose_t::FRAME_LOCAL;
    pose.origin = on_rear_axle_ ? pose_t::ORIGIN_REAR_AXLE : pose_t::ORIGIN_IMU;
    pose.scale = pose_t::SCALE_METRIC;
    pose.state = state_code(report.phase);
    pose.reason = report.reason;
    pose.reset_counter = report.reset_counter;
    pose.reset_delta_q_wxyz[0] = 1.0;  // resets of this odometry lose the way, they do not move the pose
    outputs.publish(0, pose);
  }

  void digest(Digest& digest) const override {
    digest.add(odometry_.state().x);
    digest.add(odometry_.state().P);
  }

  [[nodiscard]] std::vector<uint8_t> save() const override {
    StateWriter writer;
    writer.put(slot_.last());
    odometry_.save(writer);
    return writer.take();
  }

  void load(std::span<const uint8_t> state) override {
    StateReader reader(state);
    WheelOdometry loaded(odometry_.config());
    const auto slot = reader.get<int64_t>();
    loaded.load(reader);
    reader.finish();
    odometry_ = loaded;
    slot_.set_last(slot);
    pending_.clear();
  }

  [[nodiscard]] std::vector<uint8_t> memory() const override {
    StateWriter writer;
    if (const std::optional<WheelMemory> memory = odometry_.memory()) {
      writer.put(memory->gyro_bias);
      writer.put(memory->gyro_bias_sigma);
    }
    return writer.take();
  }

  [[nodiscard]] std::string effective_config() const override { return config_text(config_); }
  [[nodiscard]] std::string explained_config() const override { return explained_config_text(config_); }
  [[nodiscard]] std::string effective_calibration() const override { return calibration_; }

 private:
  /// A clock sample that the horizon has not reached.
  struct PendingSample {
    int64_t utime = 0;
    Sample sample;
  };

  void restore(const std::vector<uint8_t>& bytes) {
    WheelMemory memory;
    if (bytes.size() != 6 * sizeof(double)) return;  // written by another version
    StateReader reader(bytes);
    reader.get(memory.gyro_bias);
    reader.get(memory.gyro_bias_sigma);
    odometry_.restore(memory);
  }

  static void add(WheelOdometry& odometry, const Sample& sample) {
    std::visit([&](const auto& s) { (void)odometry.add(s); }, sample);
  }

  WheelOdometryConfig config_;
  std::string calibration_;
  Eigen::Quaterniond q_vehicle_body_;  ///< of the calibration
  bool on_rear_axle_;
  PublishSlot slot_;
  StageSpec spec_;
  WheelOdometry odometry_;  ///< at the horizon
  std::deque<PendingSample> pending_;
};

constexpr double kMicrotesla = 1e-6;  ///< T

/// Random walk that a Gauss-Markov process is over times short against its correlation.
void take_walk(const std::optional<double>& sigma, const std::optional<double>& correlation_s, double& walk) {
  if (sigma && correlation_s) walk = *sigma * std::sqrt(2.0 / *correlation_s);
}

}  // namespace

WheelSensors wheel_sensors(const Calibration& told) {
  const Calibration calibration = told.in_vehicle_axes();
  WheelSensors s;
  if (const auto& imu = calibration.sensors.imu) {
    take_known(imu->gyro_noise, s.gyro_noise);
    take_known(imu->accel_noise, s.accel_noise);
    take_known(imu->gyro_bias_std, s.gyro_bias_std);
    take_known(imu->accel_bias_std, s.accel_bias_std);
    take_known(imu->scale_std, s.gyro_scale_std);
    take_walk(imu->gyro_bias_std, imu->correlation, s.gyro_bias_walk);
    take_walk(imu->accel_bias_std, imu->accel_correlation ? imu->accel_correlation : imu->correlation,
              s.accel_bias_walk);
  }
  if (const auto& wheels = calibration.sensors.wheels) {
    take_known(wheels->speed_scale_std, s.wheel_scale_std);
    take_known(wheels->speed_noise, s.wheel_noise);
    s.track_width = wheels->track_width;
  }
  const PlaceOnVehicle axle = calibration.rear_axle();
  s.p_imu_axle = axle.p;
  s.p_imu_axle_std = axle.std;
  if (const auto& mag = calibration.sensors.mag) {
    if (mag->hard_iron) s.hard_iron = kMicrotesla * *mag->hard_iron;
    take_known(mag->soft_iron, s.soft_iron);
  }
  if (calibration.mounting && calibration.mounting->std_deg) s.mounting_std = kDegree * *calibration.mounting->std_deg;
  return s;
}

std::unique_ptr<Stage> make_wheel_odometry(const Calibration& calibration, const WheelOdometryConfig& config) {
  return std::make_unique<WheelOdometryStage>(calibration, config);
}

std::unique_ptr<Stage> make_wheel_odometry(const std::filesystem::path& vehicle_dir) {
  return make_wheel_odometry(load_calibration(vehicle_dir),
                             load_config_or_defaults<WheelOdometryConfig>(vehicle_dir / "wheel_odometry.yaml"));
}

}  // namespace roadfix
