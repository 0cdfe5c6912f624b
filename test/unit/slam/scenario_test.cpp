/// The tracker on the scenarios, by simulated tracks: where it must keep its pose and where it must report a loss.
#include <catch2/catch.hpp>
#include <cstdio>
#include <fstream>

#include "fed_tracker.h"

namespace roadfix {
namespace {

using test::exact_lens;
using test::FedTracker;
using test::shortened;

struct Course {
  int frames = 0, tracked = 0;
  double path = 0.0, error = 0.0;          ///< m, error at the end
  std::optional<double> lost_s;            ///< time of the reported loss
  int false_inliers = 0, outliers = 0;     ///< of moving objects and wrong tracks
  int true_inliers = 0, observations = 0;  ///< of the others, with known points
  int keyframes = 0;
};

Course run(const ScenarioConfig& config, uint64_t seed, const TrackConfig& tracks = {}) {
  const test::TrackDrive d = test::make_track_drive(config, seed, tracks);
  FedTracker tracker(exact_lens(), d.drive.config);
  Course c;
  std::optional<SE3> T_local_enu;
  std::optional<Eigen::Vector3d> before;
  for (const auto& event : d.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    const double t_s = seconds_between(config.start_utime, frame->t_us);
    const TrackedFrame& out = tracker.process(frame->t_us, frame->tracks);
    const SE3 truth = d.truth(*frame).T_frame_vehicle;
    if (before) c.path += (truth.p - *before).norm();
    before = truth.p;
    ++c.frames;
    if (out.state == TrackState::kLost && !c.lost_s) c.lost_s = t_s;
    std::map<int64_t, bool> wrong;
    for (const TrackObservation& o : frame->tracks) wrong[o.id] = o.is_outlier;
    for (const TrackedFeature& used : out.features) {
      if (used.status != FeatureStatus::kInlier && used.status != FeatureStatus::kOutlier) continue;
      const bool inlier = used.status == FeatureStatus::kInlier;
      (wrong[used.feature.track] ? c.outliers : c.observations) += 1;
      (wrong[used.feature.track] ? c.false_inliers : c.true_inliers) += inlier ? 1 : 0;
    }
    if (out.odometry.validity != Validity::kValid) continue;
    ++c.tracked;
    if (!T_local_enu) T_local_enu = out.odometry.T_frame_vehicle * truth.inverse();
    c.error = (out.odometry.T_frame_vehicle.p - (*T_local_enu * truth).p).norm();
  }
  c.keyframes = static_cast<int>(tracker->last().num_keyframes);
  std::printf("%s: tracked %d/%d, error %.3f m after %.0f m, %d of %d wrong tracks taken, keyframes %d\n",
              config.name.c_str(), c.tracked, c.frames, c.error, c.path, c.false_inliers, c.outliers, c.keyframes);
  return c;
}

TEST_CASE("every lit road is tracked and moving objects are rejected", "[statistics]") {
  for (const char* name : {"city_loop", "highway", "car_park", "cold_start_moving", "turn", "demo", "long_city"}) {
    CAPTURE(name);
    const Course c = run(shortened(name, 40.0), 2);
    CHECK(c.tracked >= 0.99 * c.frames);
    CHECK(c.error < 0.005 * c.path + 0.02);
    CHECK(c.true_inliers > 0.85 * c.observations);
    CHECK(c.outliers > 100);
    CHECK(c.false_inliers < 0.02 * c.true_inliers);
  }
}

TEST_CASE("a lit tunnel is tracked") {
  ScenarioConfig config = shortened("tunnel_lit", 45.0);
  config.scene.segments = {{0.0, StreetKind::kStreet}, {15.0, StreetKind::kBridge}, {25.0, StreetKind::kTunnelLit}};
  const Course c = run(config, 3);
  CHECK(c.tracked >= 0.99 * c.frames);
  CHECK(c.error < 0.005 * c.path);
}

TEST_CASE("an image upside down gives no inverted pose") {
  const ScenarioConfig config = shortened("city_loop", 20.0);
  const test::TrackDrive d = test::make_track_drive(config, 4, {});
  FedTracker tracker(exact_lens(), d.drive.config);
  const CameraIntrinsics lens = intrinsics_of(d.drive.config.camera);
  constexpr int kUpright = 100;
  int frames = 0, valid = 0;
  for (const auto& event : d.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr || frames == kUpright + 3) continue;
    std::vector<TrackObservation> tracks = frame->tracks;
    if (frames++ >= kUpright) {
      for (TrackObservation& o : tracks) o.left = Eigen::Vector2d(2.0 * lens.cx, 2.0 * lens.cy) - o.left;
    }
    const TrackedFrame& out = tracker.process(frame->t_us, tracks);
    valid += out.odometry.validity == Validity::kValid ? 1 : 0;
    const double up = (out.odometry.T_frame_vehicle.q * Eigen::Vector3d::UnitZ()).z();
    if (frames > kUpright) CHECK(out.odometry.validity == Validity::kCoasting);
    CHECK(up > 0.9);
  }
  CHECK(valid >= kUpright - 1);
}

TEST_CASE("a standstill among moving cars adds no drift") {
  TrackConfig tracks;
  tracks.noise_px = 0.2;  // optical flow noise of a static image
  const Course c = run(shortened("standing", 30.0), 5, tracks);
  CHECK(c.tracked == c.frames);
  CHECK(c.error < 0.02);
  CHECK(c.keyframes < 0.1 * c.frames);
}

/// The start of city_loop, monocular; the car waits at a traffic light for some seconds.
struct RedLight {
  int standing = 0, valid = 0;         ///< images
  double moved = 0.0;                  ///< m, maximum, from the standstill pose
  int leaving = 0, leaving_valid = 0;  ///< images, after the pull-away
  double way = 0.0, error = 0.0;       ///< m, distance from the light by then, and its largest error
};

/// Wheels measure the speed until the standstill, or always.
RedLight red_light(double standing_flow_px, bool told_leaving) {
  static const test::TrackDrive kDrive = [] {
    TrackConfig tracks;
    tracks.noise_px = 0.2;         // as above
    tracks.loss_per_frame = 0.06;  // crossing traffic
    return test::make_track_drive(shortened("city_loop", 45.0), 7, tracks);
  }();
  KeyframeTrackerConfig config = exact_lens();
  config.standing_flow_px = standing_flow_px;
  FedTracker tracker(config, kDrive.drive.config, false);
  RedLight light;
  std::optional<Eigen::Vector3d> stopped, standstill_pose;  // estimated and true position
  int count = 0;
  for (const auto& event : kDrive.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr || ++count % 2 == 0) continue;
    const double speed = kDrive.truth(*frame).velocity.norm();
    if (!stopped || told_leaving) tracker->speed({frame->t_us, SpeedSource::kWheels, speed, 0.05, 0.01});
    const TrackedFrame& out = tracker.process(frame->t_us, frame->tracks);
    const bool valid = out.odometry.validity == Validity::kValid;
    if (stopped && speed > 0.01) {
      const double way = (kDrive.truth(*frame).T_frame_vehicle.p - *standstill_pose).norm();
      ++light.leaving;
      light.leaving_valid += valid ? 1 : 0;
      light.way = std::max(light.way, way);
      if (valid)
        light.error = std::max(light.error, std::abs((out.odometry.T_frame_vehicle.p - *stopped).norm() - way));
    }
    if (count < 200 || speed > 0.01) continue;  // it also stands at the start
    ++light.standing;
    light.valid += valid ? 1 : 0;
    if (!stopped) {
      stopped = out.odometry.T_frame_vehicle.p;
      standstill_pose = kDrive.truth(*frame).T_frame_vehicle.p;
    }
    if (valid) light.moved = std::max(light.moved, (out.odometry.T_frame_vehicle.p - *stopped).norm());
  }
  return light;
}

TEST_CASE("mono keeps its pose at a red light without landmarks and through the pull-away") {
  const double known = KeyframeTrackerConfig{}.standing_flow_px;
  const RedLight held = red_light(known, true), lost = red_light(0.0, false), not_given = red_light(known, false);
  std::printf("red light: %d of %d pictures valid, moved %.3f m; %d where standing is not known\n", held.valid,
              held.standing, held.moved, lost.valid);
  CHECK(held.standing > 20);
  CHECK(held.valid == held.standing);
  CHECK(held.moved < 0.03);
  CHECK(lost.valid < lost.standing);  // teeth
  std::printf("pulling away: %d of %d pictures valid, %.1f m, wrong by %.3f m; %d without speeds\n", held.leaving_valid,
              held.leaving, held.way, held.error, not_given.leaving_valid);
  CHECK(not_given.valid == not_given.standing);
  CHECK(held.leaving > 20);
  CHECK(held.way > 5.0);
  CHECK(held.leaving_valid == held.leaving);
  CHECK(held.error < 0.02 * held.way);
  CHECK(not_given.leaving_valid < 0.95 * not_given.leaving);  // teeth
}

/// Drives into the dark; a restart at the true pose is given at `light_s`, zero: never.
struct Dark {
  std::optional<double> blind_s, lost_s;
  int tracked_after = 0, frames_after = 0;
  double error_after = 0.0;  ///< m, at the end, of the pose after the restart
  int unannounced = 0;       ///< valid frames after the loss without a counted jump
};

Dark into_the_dark(const ScenarioConfig& config, double light_s) {
  TrackConfig tracks;
  tracks.moving_cars = false;  // their lamps are visible in the dark and are no landmarks
  const test::TrackDrive d = test::make_track_drive(config, 1, tracks);
  FedTracker tracker(exact_lens(), d.drive.config);
  Dark dark;
  bool restarted = false;
  for (const auto& event : d.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    const double t_s = seconds_between(config.start_utime, frame->t_us);
    const Odometry truth = d.truth(*frame);
    if (dark.lost_s && !restarted && light_s > 0.0 && t_s >= light_s) {
      const int64_t given_us = frame->t_us - 300'000;  // the pose is old on arrival
      const Odometry then = d.drive.truth_at(given_us);
      tracker->restart({given_us, then.T_frame_vehicle, then.velocity, 1e-4 * Matrix6d::Identity()});
      restarted = true;
    }
    const TrackedFrame& out = tracker.process(frame->t_us, frame->tracks);
    const bool valid = out.odometry.validity == Validity::kValid;
    if (out.num_landmarks_seen < exact_lens().min_inliers && dark.tracked_after == 0 && !restarted) {
      if (!dark.blind_s) dark.blind_s = t_s;
    } else if (!dark.lost_s) {
      dark.blind_s.reset();
    }
    if (out.state == TrackState::kLost && !dark.lost_s) dark.lost_s = t_s;
    if (dark.lost_s && valid && out.reset_counter == 0) ++dark.unannounced;
    if (!restarted) continue;
    ++dark.frames_after;
    if (!valid) continue;
    ++dark.tracked_after;
    dark.error_after = (out.odometry.T_frame_vehicle.p - truth.T_frame_vehicle.p).norm();
  }
  return dark;
}

TEST_CASE("a dark tunnel ends in lost within 0.5 s, a restart in the light takes the given pose") {
  ScenarioConfig config = shortened("tunnel_dark", 50.0);
  config.scene.segments = {{0.0, StreetKind::kStreet}, {15.0, StreetKind::kTunnelDark}, {30.0, StreetKind::kStreet}};
  const Dark dark = into_the_dark(config, 34.0);
  REQUIRE(dark.lost_s);
  REQUIRE(dark.blind_s);
  std::printf("tunnel_dark: blind at %.1f s, lost at %.1f s, then %d of %d frames, error %.2f m\n", *dark.blind_s,
              *dark.lost_s, dark.tracked_after, dark.frames_after, dark.error_after);
  CHECK(*dark.lost_s - *dark.blind_s <= 0.5);
  CHECK(dark.unannounced == 0);
  CHECK(dark.tracked_after >= dark.frames_after - 1);
  CHECK(dark.error_after < 1.5);  // 0.3 s at 14 m/s were unobserved
}

TEST_CASE("bare corridor walls give no map: lost within 0.5 s") {
  ScenarioConfig config = shortened("corridor", 40.0);
  config.scene.segments = {{0.0, StreetKind::kCorridor}};
  const Course c = run(config, 1);
  CHECK(c.tracked == 0);
  REQUIRE(c.lost_s);
  CHECK(*c.lost_s <= 0.5);
}

TEST_CASE("a restart after a bare corridor takes the given pose") {
  ScenarioConfig config = shortened("city_loop", 40.0);
  config.scene.segments = {{0.0, StreetKind::kCorridor}, {20.0, StreetKind::kStreet}};
  const Dark dark = into_the_dark(config, 26.0);
  REQUIRE(dark.lost_s);
  std::printf("corridor to street: lost at %.1f s, then %d of %d frames, error %.2f m\n", *dark.lost_s,
              dark.tracked_after, dark.frames_after, dark.error_after);
  CHECK(*dark.lost_s - dark.blind_s.value_or(0.0) <= 0.5);
  CHECK(dark.tracked_after >= dark.frames_after - 1);
  CHECK(dark.error_after < 1.5);
}

TEST_CASE("the state of a long drive is bounded") {
  const test::TrackDrive d = test::make_track_drive(shortened("city_loop", 60.0), 7);
  KeyframeTrackerConfig config = exact_lens();
  config.close_loops = true;
  config.max_places = 10;
  FedTracker tracker(config, d.drive.config);
  std::vector<size_t> sizes;
  int count = 0;
  for (const auto& event : d.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    (void)tracker.process(frame->t_us, frame->tracks);
    if (++count % 150 != 0) continue;
    StateWriter writer;
    tracker->save(writer);
    sizes.push_back(writer.take().size());
  }
  REQUIRE(sizes.size() == 4);
  CHECK(10 * sizes[3] < 13 * std::max(sizes[1], sizes[2]));
}

/// Resident memory of the process, bytes.
size_t resident() {
  std::ifstream statm("/proc/self/statm");
  size_t total = 0, pages = 0;
  statm >> total >> pages;
  return pages * 4096;
}

/// Half an hour at five images per second.
struct HalfHour {
  std::vector<size_t> states, residents;  ///< bytes, every two minutes
  int frames = 0, valid = 0;              ///< since the start of motion in a lap: mono needs parallax
};

HalfHour half_hour(bool stereo) {
  constexpr int kLaps = 15;  // of two minutes each: new tracks in each lap, and a restart at its start
  static const test::TrackDrive kDrive = test::make_track_drive(shortened("city_loop", 120.0), 7);
  KeyframeTrackerConfig config = exact_lens();
  config.close_loops = true;
  config.max_places = 50;
  FedTracker tracker(config, kDrive.drive.config, stereo);
  const Odometry begin = kDrive.drive.truth_at(kDrive.drive.config.start_utime);
  HalfHour half;
  for (int lap = 0; lap < kLaps; ++lap) {
    int count = 0;
    bool under_way = false;
    for (const auto& event : kDrive.events) {
      const auto* frame = std::get_if<test::TrackFrame>(&event);
      if (frame == nullptr || ++count % 2 == 0) continue;
      std::vector<TrackObservation> tracks = frame->tracks;
      for (TrackObservation& o : tracks) o.id += 1'000'000'000LL * lap;
      const int64_t t_us = frame->t_us + 121'000'000LL * lap;
      const Odometry truth = kDrive.truth(*frame);
      if (!stereo) tracker->speed({t_us, SpeedSource::kWheels, truth.velocity.norm(), 0.05, 0.01});
      const TrackedFrame& out = tracker.process(t_us, tracks);
      under_way = under_way || (truth.T_frame_vehicle.p - begin.T_frame_vehicle.p).norm() > 5.0;
      if (!under_way) continue;
      ++half.frames;
      half.valid += out.odometry.validity == Validity::kValid ? 1 : 0;
    }
    StateWriter writer;
    tracker->save(writer);
    half.states.push_back(writer.take().size());
    half.residents.push_back(resident());
    tracker->restart({kDrive.drive.config.start_utime + 121'000'000LL * (lap + 1), begin.T_frame_vehicle,
                      begin.velocity, 1e-4 * Matrix6d::Identity()});
  }
  return half;
}

TEST_CASE("half an hour keeps memory bounded", "[statistics]") {
  for (const bool stereo : {true, false}) {
    const HalfHour half = half_hour(stereo);
    const auto mb = [](size_t bytes) { return 1e-6 * static_cast<double>(bytes); };
    std::printf(
        "half an hour, %s: %d of %d frames valid, state %.2f MB after 4 min, %.2f after 30; resident %+.2f MB\n",
        stereo ? "stereo" : "mono", half.valid, half.frames, mb(half.states[1]), mb(half.states.back()),
        mb(half.residents.back()) - mb(half.residents[1]));
    CHECK(half.frames > 7500);
    CHECK(half.valid > 0.99 * half.frames);
    CHECK(10 * half.states.back() < 12 * *std::max_element(half.states.begin(), half.states.begin() + 3));
    CHECK(mb(half.residents.back()) < mb(half.residents[1]) + 10.0);
  }
}

}  // namespace
}  // namespace roadfix
