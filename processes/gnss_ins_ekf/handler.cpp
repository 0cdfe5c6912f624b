#include "gnss_ins_ekf/handler.h"

#include <roadfix/imu_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/run/publish_slot.h"
#include "bus/sample_codec.h"
#include "bus/track_codec.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "gnss_ins_ekf/messages.h"
#include "gnss_ins_ekf/vehicle_facts.h"
#include "navigation/navigation.h"
#include "stream/state_bytes.h"

namespace roadfix {

namespace {

constexpr int64_t kTracksLateness_us = 200'000;  // exposure, transport, tracking

enum Input { kImu = 0, kGnss = 1, kWheels = 2, kMag = 3, kStart = 4, kPrior = 5, kTracks = 6 };
enum Output { kPose = 0, kStatus = 1, kAiding = 2 };

class GnssInsStage final : public Stage {
 public:
  GnssInsStage(const Calibration& calibration, const GnssInsProcessConfig& config)
      : config_(config),
        calibration_(calibration_text(calibration)),
        q_vehicle_body_(calibration.q_vehicle_body()),
        pose_slot_(config.publish_period),
        status_slot_(config.status_period) {
    static_cast<navigation::NavigationTuning&>(filter_config_) = config.navigation;
    filter_config_.facts = vehicle_facts(calibration);
    // Without the declination a magnetic heading is not a heading.
    if (!calibration.sensors.mag || !calibration.sensors.mag->declination_deg)
      filter_config_.sources.magnetic_heading = false;
    filter_.emplace(filter_config_);
    spec_.name = "gnss_ins_ekf";
    spec_.inputs = {
        {"IMU", "imu_t", 0, 0},      {"GNSS", "gnss_t", 250'000, 0},          {"WHEELS", "wheels_t", 50'000, 0},
        {"MAG", "mag_t", 50'000, 0}, {"START_GNSS_INS_EKF", "state_t", 0, 0}, {"PRIOR_POSE", "pose_t", 250'000, 0}};
    if (filter_config_.sources.camera && filter_config_.facts.camera)
      spec_.inputs.push_back({"VO_FEATURES", "vo_features2_t", kTracksLateness_us, 0});
    spec_.state_layout = 41;
    // A car without an IMU is driven by its wheels.
    spec_.clocks = {{kImu, 200'000}, {kWheels, 500'000}};
    spec_.outputs = {{"POSE_INS", "pose_t"}, {"INS_STATUS", "ins_status_t"}, {"AIDING_INS", "aiding_t"}};
  }

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }

  void apply(const Message& m) override {
    switch (m.input) {
      case kImu:
        (void)filter_->advance(imu(m));
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
      case kPrior:
        filter_->add(prior_pose(decode<pose_t>(m.bytes)), m.seq);
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
    if (m.input == kImu) (void)filter_->see(imu(m));
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
      ins_status_t status = ins_status(filter_->status(), filter_->filter(), filter_config_.facts, q_vehicle_body_);
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
  [[nodiscard]] ImuSample imu(const Message& m) const {
    return in_axes(q_vehicle_body_, imu_sample(decode<imu_t>(m.bytes)));
  }

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
  Eigen::Quaterniond q_vehicle_body_;  ///< of the calibration
  navigation::NavigationConfig filter_config_;
  StageSpec spec_;
  std::optional<navigation::Navigation> filter_;
  PublishSlot pose_slot_, status_slot_;
  bool waits_for_imu_ = false;  // this tick came from another clock
};

}  // namespace

std::unique_ptr<Stage> make_gnss_ins_ekf(const Calibration& calibration, const GnssInsProcessConfig& config) {
  return std::make_unique<GnssInsStage>(calibration, config);
}

std::unique_ptr<Stage> make_gnss_ins_ekf(const std::filesystem::path& vehicle_dir) {
  return make_gnss_ins_ekf(load_calibration(vehicle_dir),
                           load_config_or_defaults<GnssInsProcessConfig>(vehicle_dir / "gnss_ins_ekf.yaml"));
}

}  // namespace roadfix
