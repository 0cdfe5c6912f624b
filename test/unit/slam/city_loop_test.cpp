/// Two laps of the scenario city_loop, by tracks whose points carry rendered patches: loop closure and its benefit.
#include <catch2/catch.hpp>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <random>

#include "fed_tracker.h"

namespace roadfix {
namespace {

using test::exact_lens;
using test::FedTracker;
using test::shortened;

/// Points along a drive, each with a patch of its own in a synthetic image.
class PaintedWorld {
 public:
  PaintedWorld(const SimulatedDrive& drive, double until_s) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    std::optional<Eigen::Vector3d> last;
    for (double t = 0.0; t < until_s; t += 0.1) {
      const SE3 T = drive.truth_at(drive.config.start_utime + static_cast<int64_t>(1e6 * t)).T_frame_vehicle;
      if (last && (T.p - *last).norm() < 1.0) continue;
      last = T.p;
      for (int i = 0; i < 6; ++i) {
        const double side = unit(random) < 0.5 ? -1.0 : 1.0;
        points_.emplace_back(T * Eigen::Vector3d(unit(random), side * (4.0 + 16.0 * unit(random)), 6.0 * unit(random)));
        cv::Mat& patch = patches_.emplace_back(kPatch, kPatch, CV_8UC1);
        for (int k = 0; k < kPatch * kPatch; ++k) patch.data[k] = static_cast<uint8_t>(random() & 0xFFU);
        cv::resize(patch.rowRange(0, kPatch / 4).colRange(0, kPatch / 4).clone(), patch, patch.size());
      }
    }
    seen_last_.assign(points_.size(), -2);
    visit_.assign(points_.size(), 0);
  }

  /// Observations of the rig, rendered. A point that re-enters the view is a new track.
  std::vector<TrackObservation> observe(const SE3& T_enu_left, const SE3& T_right_left, const Camera& camera,
                                        double noise_px, int frame, cv::Mat& image) {
    image.setTo(100);
    std::mt19937 random(static_cast<unsigned>(1000 + frame));
    std::normal_distribution<double> noise(0.0, noise_px);
    const SE3 T_left_enu = T_enu_left.inverse();
    std::vector<TrackObservation> all;
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d p = T_left_enu * points_[i];
      if (p.z() < 4.0 || p.z() > 45.0) continue;
      const auto left = camera.project(p), right = camera.project(T_right_left * p);
      if (!left || !right || !camera.sees(*left, 20.0) || !camera.sees(*right)) continue;
      if (seen_last_[i] < frame - 1) ++visit_[i];
      seen_last_[i] = frame;
      TrackObservation o{};
      o.p_enu = points_[i];
      o.id = visit_[i] * 1'000'000 + static_cast<int64_t>(i);
      o.left = *left + Eigen::Vector2d(noise(random), noise(random));
      o.right = *right + Eigen::Vector2d(noise(random), noise(random));
      const int u = static_cast<int>(std::lround(left->x())), v = static_cast<int>(std::lround(left->y()));
      patches_[i].copyTo(image(cv::Rect(u - kPatch / 2, v - kPatch / 2, kPatch, kPatch)));
      all.push_back(o);
    }
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
    return all;
  }

 private:
  static constexpr int kPatch = 33;
  std::vector<Eigen::Vector3d> points_;
  std::vector<cv::Mat> patches_;
  std::vector<int> seen_last_;
  std::vector<int64_t> visit_;
};

struct TwoLaps {
  int loops = 0, frames = 0, tracked = 0, jumps = 0, closed_jumps = 0;
  double path = 0.0, second_path = 0.0;  ///< m
  std::vector<double> closed, open;      ///< m, errors on the second lap, ascending
};

double middle(const std::vector<double>& ascending) { return ascending.at(ascending.size() / 2); }

/// The second lap starts when the car passes its first pose again.
TwoLaps two_laps() {
  ScenarioConfig config = shortened("city_loop", 240.0);
  const SimulatedDrive drive = simulate(config, 1);
  KeyframeTrackerConfig tuned = exact_lens();
  tuned.close_loops = true;
  FedTracker tracker(tuned, config);
  PaintedWorld world(drive, config.duration_s);
  const Camera camera(intrinsics_of(config.camera));
  const SE3 T_vehicle_left = nominal_T_vehicle_left(config.camera),
            T_right_left = T_left_right(config.camera).inverse();
  TwoLaps laps;
  std::optional<SE3> T_local_enu;
  std::optional<Eigen::Vector3d> first, before;
  double farthest = 0.0;
  bool second = false;
  for (int i = 0; 0.2 * i < config.duration_s - 1.0; ++i) {
    const int64_t t_us = config.start_utime + 200'000 * i;
    const SE3 truth = drive.truth_at(t_us).T_frame_vehicle;
    const auto tracks = world.observe(truth * T_vehicle_left, T_right_left, camera, 0.4, i, tracker.image());
    const TrackedFrame& out = tracker.process(t_us, tracks);
    const double moved = before ? (truth.p - *before).norm() : 0.0;
    before = truth.p;
    if (!first) first = truth.p;
    farthest = std::max(farthest, (truth.p - *first).norm());
    second = second || (farthest > 100.0 && (truth.p - *first).norm() < 5.0);
    laps.path += moved;
    laps.second_path += second ? moved : 0.0;
    ++laps.frames;
    laps.jumps = out.reset_counter;
    laps.closed_jumps = out.closed_reset_counter;
    if (out.odometry.validity != Validity::kValid) continue;
    ++laps.tracked;
    if (!T_local_enu) T_local_enu = out.odometry.T_frame_vehicle * truth.inverse();
    if (!second) continue;
    const Eigen::Vector3d p = (*T_local_enu * truth).p;
    laps.open.push_back((out.odometry.T_frame_vehicle.p - p).norm());
    laps.closed.push_back((tracker->closed(out.odometry).T_frame_vehicle.p - p).norm());
  }
  laps.loops = tracker->last().num_loops;
  std::sort(laps.open.begin(), laps.open.end());
  std::sort(laps.closed.begin(), laps.closed.end());
  return laps;
}

TEST_CASE("city_loop closes its loop, and the second lap's error is below 0.3 % of the path", "[statistics]") {
  const TwoLaps laps = two_laps();
  REQUIRE(laps.closed.size() > 300);
  std::printf(
      "city_loop: tracked %d/%d, %d loops, path %.0f m, %.0f m of it again; there the error is %.2f m, at most %.2f m, "
      "and %.2f and %.2f m with the loops open\n",
      laps.tracked, laps.frames, laps.loops, laps.path, laps.second_path, middle(laps.closed), laps.closed.back(),
      middle(laps.open), laps.open.back());
  CHECK(laps.tracked == laps.frames);
  CHECK(laps.loops >= 5);
  CHECK(laps.closed.back() < 0.003 * laps.second_path);
  CHECK(middle(laps.closed) < 0.5 * middle(laps.open));  // teeth: the same drive without loop closure
  CHECK(laps.jumps == 0);                                // the odometry pose never jumps
  CHECK(laps.closed_jumps == laps.loops);                // the closed pose counts each jump
}

}  // namespace
}  // namespace roadfix
