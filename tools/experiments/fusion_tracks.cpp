// A simulated drive through the whole stack, with tracks in place of pictures: the keyframe tracker as vo_tracker runs
// it (speeds of wheels and INS, the INS's level, restarts of the fusion, 0.5 s late), a hundred times faster than by
// drawing.
//   fusion_tracks SCENARIO SEED LOG VEHICLE OUT
// LOG and VEHICLE are what `roadfix simulate SCENARIO --seed SEED --no-camera` made; OUT is for `roadfix evaluate`.
#include <cstdio>
#include <roadfix/image_t.hpp>
#include <roadfix/wheels_t.hpp>
#include <stdexcept>

#include "bus/log/log_writer.h"
#include "bus/run/replay.h"
#include "bus/sample_codec.h"
#include "config/calibration.h"
#include "geometry/determinism.h"
#include "gnss_ins_ekf/handler.h"
#include "imm_fusion/handler.h"
#include "program.h"
#include "simulation/scenarios.h"
#include "slam/keyframe_tracker.h"
#include "support/simulated_tracks.h"
#include "support/track_drive.h"
#include "vo_tracker/messages.h"
#include "wheel_odometry/handler.h"

namespace roadfix {
namespace {

/// As far off as patches are that are followed through drawn pictures: tracks differ, and the tracker loses as much
/// (scripts/drift, tunnel_lit, stereo, in pictures and here; lib/slam/EVIDENCE.md).
TrackConfig as_in_pictures() {
  TrackConfig tracks;
  tracks.noise_px = 0.34;
  tracks.noise_spread = 0.95;
  return tracks;
}

constexpr int64_t kFeedback_us = 500'000, kWheels_us = 50'000;  // as in vo_tracker/keyframe_stage.cpp

/// vo_tracker's keyframe stage, but for its pictures.
class TracksStage final : public Stage {
 public:
  TracksStage(const test::TrackDrive& drive, const Calibration& calibration)
      : calibration_(calibration),
        picture_(drive.drive.config.camera.height_px, drive.drive.config.camera.width_px, CV_8UC1) {
    for (int i = 0; i < static_cast<int>(picture_.total()); ++i) picture_.data[i] = static_cast<uint8_t>(i % 2 * 64);
    for (const test::DriveEvent& e : drive.events)
      if (const auto* frame = std::get_if<test::TrackFrame>(&e)) frames_[frame->t_us] = frame->tracks;
    const ScenarioConfig& scenario = drive.drive.config;
    CameraRig rig;
    rig.left = intrinsics_of(scenario.camera);
    rig.right = rig.left;
    rig.T_vehicle_left = drive.T_vehicle_left;
    rig.T_right_left = drive.T_left_right.inverse();
    rig.scale_sigmas = {};  // as the calibration of a drive says that is rendered: these are the very lenses
    tracker_ = std::make_unique<KeyframeTracker>(KeyframeTrackerConfig{}, rig,
                                                 std::make_unique<test::SimulatedFrontEnd>(seen_), executor_,
                                                 std::make_unique<test::SimulatedRightEye>(seen_));
    spec_.name = "vo_tracker";
    spec_.inputs = {{"CAMERA_LEFT", "image_t", 0, 0},
                    {"WHEELS", "wheels_t", 0, kWheels_us},
                    {"POSE_INS", "pose_t", 0, kFeedback_us},
                    {"VO_RESTART", "vo_restart_t", 0, kFeedback_us}};
    spec_.clocks = {{0, 250'000}};
    spec_.outputs = {{"POSE_VO", "pose_t"}, {"VO_STATUS", "vo_status_t"}};
    spec_.snapshots = Snapshots::kOnRequest;
  }

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }
  void on_clock(const Message&) override {}
  void apply(const Message& m) override {
    if (m.input == 0) {
      seen_->now.clear();
      for (const TrackObservation& o : frames_.at(m.utime)) seen_->now.emplace(o.id, o);
      tracker_->process({m.utime, picture_, picture_});
    } else if (m.input == 1) {
      const auto speed = wheel_speed(wheel_sample(decode<wheels_t>(m.bytes)), calibration_.sensors.wheels);
      if (speed) tracker_->speed(*speed);
    } else if (m.input == 2) {
      const Odometry ins = odometry(decode<pose_t>(m.bytes));
      if (const auto speed = ins_speed(ins)) tracker_->speed(*speed);
      if (const auto level = ins_level(ins, {})) tracker_->add_attitude(*level);
    } else {
      tracker_->restart(restart(decode<vo_restart_t>(m.bytes)));
    }
  }
  void publish(int64_t now_utime, Outputs& outputs) override {
    const TrackedFrame& frame = tracker_->last();
    pose_t pose = vo_pose(frame, tracker_->at(now_utime), calibration_.body_origin.value_or(BodyOrigin::kImu));
    outputs.publish(0, pose);
    vo_status_t status = vo_status(frame, tracker_->considered_at(now_utime), FrontEndKind::kKlt);
    outputs.publish(1, status);
  }
  void digest(Digest& digest) const override { tracker_->digest(digest); }
  [[nodiscard]] std::vector<uint8_t> save() const override { return {}; }
  void load(std::span<const uint8_t>) override { throw std::runtime_error("no snapshots of tracks"); }
  [[nodiscard]] std::string effective_config() const override { return {}; }

 private:
  Calibration calibration_;
  std::map<int64_t, std::vector<TrackObservation>> frames_;
  std::shared_ptr<test::SeenTracks> seen_ = std::make_shared<test::SeenTracks>();
  cv::Mat picture_;
  InlineExecutor executor_;
  std::unique_ptr<KeyframeTracker> tracker_;
  StageSpec spec_;
};

/// The log with an empty picture for each frame: the tracker's clock.
void add_ticks(const std::filesystem::path& in, const test::TrackDrive& drive, const std::filesystem::path& out) {
  LogReader reader(in);
  LogWriter writer(out);
  while (const std::optional<LogEvent> event = reader.next()) {
    writer.write(event->channel, event->timestamp_us, event->data);
  }
  image_t tick{};
  tick.run = drive.drive.config.start_utime;
  std::vector<uint8_t> bytes;
  for (const test::DriveEvent& e : drive.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&e);
    if (frame == nullptr) continue;
    tick.utime = frame->t_us;
    encode_into(tick, bytes);
    writer.write("CAMERA_LEFT", tick.utime, bytes);
    ++tick.seq;
  }
  writer.commit();
}

/// The drive without a camera, as the log has it, and with one are the same drive.
void check_same_drive(const test::TrackDrive& drive, uint64_t seed) {
  ScenarioConfig config = drive.drive.config;
  config.camera.layout = CameraLayout::kNone;
  const SimulatedDrive blind = simulate(config, seed);
  const bool imu = blind.imu.back().accel == drive.drive.imu.back().accel;
  const auto fix = [](const SimulatedDrive& d) { return d.gnss.empty() ? 0.0 : d.gnss.back().antenna.latitude; };
  if (!imu || fix(blind) != fix(drive.drive))
    throw std::runtime_error("a camera changes the other sensors of this drive");
}

int run(int argc, char** argv) {
  if (argc != 6) throw std::invalid_argument("usage: fusion_tracks SCENARIO SEED LOG VEHICLE OUT");
  fix_eigen_blocking();
  const auto seed = static_cast<uint64_t>(std::stoull(argv[2]));
  const test::TrackDrive drive = test::make_track_drive(scenario(argv[1]), seed, as_in_pictures());
  check_same_drive(drive, seed);
  const std::filesystem::path vehicle = argv[4], out = argv[5];
  const std::filesystem::path ticking = out.string() + ".ticking";
  add_ticks(argv[3], drive, ticking);
  std::vector<std::unique_ptr<Stage>> stages;
  stages.push_back(make_wheel_odometry(vehicle));
  stages.push_back(make_gnss_ins_ekf(vehicle));
  stages.push_back(std::make_unique<TracksStage>(drive, load_calibration(vehicle)));
  stages.push_back(make_imm_fusion(vehicle));
  const ReplaySummary summary = replay(ticking, out, std::move(stages));
  std::filesystem::remove(ticking);
  std::printf("%s: %lld messages written\n", out.c_str(), static_cast<long long>(summary.outputs));
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("fusion_tracks", roadfix::run, argc, argv); }
