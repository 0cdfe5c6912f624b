/// Consistency of the covariance on simulated streets, by simulated tracks.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <random>

#include "geometry/determinism.h"
#include "simulation/scene/street.h"
#include "slam/keyframe_tracker.h"
#include "slam/pose_covariance.h"
#include "support/simulated_tracks.h"

namespace roadfix {
namespace {

constexpr int kFrames = 110;
constexpr int kStraight = 80;  // first frame after the bend
constexpr double kStep = 1.0;  // m per frame, 10 m/s
constexpr double kBaseline = 0.5;

const CameraIntrinsics kLens{800, 400, 460.0, 460.0, 400.0, 200.0, Distortion::kNone, {}};

/// Straight, a bend from the seed, up to `sharpness` times 57 degrees, straight.
SE3 true_pose(int frame, uint64_t seed, double sharpness) {
  const double bend = sharpness * 0.02 * (static_cast<double>(seed % 7) - 3.0) / 3.0;  // rad a frame
  SE3 T;
  for (int i = 0; i < frame; ++i) {
    const double turn = i > 30 && i < kStraight ? bend : 0.0;
    const Eigen::Quaterniond half(Eigen::AngleAxisd(0.5 * turn, Eigen::Vector3d::UnitZ()));
    T.p += kStep * (T.q * half * Eigen::Vector3d::UnitX());
    T.q = T.q * half * half;
  }
  return T;
}

/// Looking along the vehicle's x, 1.6 m above the ground.
const SE3 kVehicleLeft{Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.0, 0.0, 1.6}};

/// One pose and the ground truth in the horizontal plane, in the vehicle's axes: forward, left, yaw.
struct Passed {
  Eigen::Vector3d error;
  Eigen::Matrix3d image, map;  ///< the covariances that do not accumulate
  SE3 T_local_vehicle;
  Matrix6d added;  ///< the one that does
};

struct Drive {
  std::vector<Passed> passed;
  double nees = 0.0;                ///< of the last pose relative to the first, per degree of freedom
  double error = 0.0, sigma = 0.0;  ///< m, of its position
  double last_way = 0.0;            ///< along the last straight, over the true one
  int valid = 0;
};

Eigen::Matrix3d seen_from_above(const Matrix6d& cov, const Eigen::Matrix3d& R_local_vehicle) {
  Eigen::Matrix<double, 3, 6> to_vehicle = Eigen::Matrix<double, 3, 6>::Zero();
  to_vehicle.topLeftCorner<2, 3>() = R_local_vehicle.transpose().topRows<2>();
  to_vehicle(2, 5) = 1.0;
  return to_vehicle * cov * to_vehicle.transpose();
}

/// Calibration errors, and their configured sigmas.
struct Calibrated {
  double focal_error = 0.0;                                    ///< relative
  double scale_error = 0.0;                                    ///< relative, of what stereo measures
  double right_shift_px = 0.0;                                 ///< lateral shift of the right image
  double right_turn_std_deg = 0.0;                             ///< configured
  Eigen::Vector2d right_decentring = Eigen::Vector2d::Zero();  ///< camera/decentring.h
  double right_decentring_std = 0.0;                           ///< configured
  ScaleSigmas scale_sigmas = {};                               ///< the same
  double focal_std = 0.0;                                      ///< configured, monocular
  int right_until = kFrames;                                   ///< frames with a right image
  bool wheels = false;                                         ///< beside stereo
  double sharpness = 1.0;                                      ///< of the bend
  Eigen::Vector3d turn_radpm = Eigen::Vector3d::Zero();        ///< that all tracks pretend, camera axes
  double drift_radpm = 0.0;                                    ///< configured
  FrontEndKind kind = FrontEndKind::kKlt;                      ///< that the tracks are said to be of
};

Drive drive(uint64_t seed, bool stereo, double noise_px, const Calibrated& calibrated) {
  fix_eigen_blocking();
  StreetPlan plan;
  for (int i = -10; i < kFrames + 60; ++i) {
    const SE3 T = true_pose(std::clamp(i, 0, kFrames), seed, calibrated.sharpness);
    plan.driven.emplace_back(T.p + (i - std::clamp(i, 0, kFrames)) * (T.q * Eigen::Vector3d::UnitX()));
  }
  plan.segments = {{0.0, StreetKind::kStreet}};
  plan.seed = seed;
  const World world = build_world(plan);
  CameraRig rig;
  rig.left = kLens;
  rig.left.fx = rig.left.fy = kLens.fx * (1.0 + calibrated.focal_error);
  rig.T_vehicle_left = kVehicleLeft;
  const SE3 T_left_right{Eigen::Quaterniond::Identity(), {kBaseline, 0.0, 0.0}};
  if (stereo) {
    rig.right = rig.left;
    rig.T_right_left = T_left_right.inverse();
    rig.T_right_left.p *= (1.0 + calibrated.scale_error) / (1.0 + calibrated.focal_error);
    rig.scale_sigmas = calibrated.scale_sigmas;
  }
  TrackConfig tracks;
  tracks.wanted = 250;
  tracks.noise_px = noise_px;
  tracks.turn_radpm = calibrated.turn_radpm;
  std::optional<TrackSimulator::RightCamera> right;
  CameraIntrinsics right_lens = kLens;
  right_lens.cx += calibrated.right_shift_px;
  if (stereo) right = TrackSimulator::RightCamera{Camera(right_lens), T_left_right};
  TrackSimulator simulator(world, tracks, Camera(kLens), right, seed);

  KeyframeTrackerConfig config;
  config.focal_std = calibrated.focal_std;
  config.radial_std = 0.0;  // exactly known
  config.drift = calibrated.drift_radpm;
  config.front_end.kind = calibrated.kind;
  config.right_turn_std_deg = calibrated.right_turn_std_deg;
  config.right_decentring_std = calibrated.right_decentring_std;
  const auto seen = std::make_shared<test::SeenTracks>();
  InlineExecutor executor;
  KeyframeTracker tracker(config, rig, std::make_unique<test::SimulatedFrontEnd>(seen), executor,
                          std::make_unique<test::SimulatedRightEye>(seen));
  cv::Mat image(kLens.height, kLens.width, CV_8UC1);
  for (int i = 0; i < static_cast<int>(image.total()); ++i) image.data[i] = static_cast<uint8_t>(37 * i);

  Drive result;
  constexpr double kSpeedSigma = 0.05;  // m/s: 5 mm per frame, the lower bound of the tracker's distance sigma
  std::mt19937 random(static_cast<unsigned>(seed));
  std::normal_distribution<double> speed_noise(0.0, kSpeedSigma);
  std::optional<SE3> T_local_enu;
  SE3 T_local_straight;
  for (int i = 0; i < kFrames; ++i) {
    const SE3 T_enu_vehicle = true_pose(i, seed, calibrated.sharpness);
    View view;
    view.t_s = 0.1 * i;
    view.T_enu_camera = T_enu_vehicle * kVehicleLeft;
    seen->now.clear();
    for (TrackObservation o : simulator.observe(view)) {
      if (o.right) {
        const auto n = Camera(right_lens).unproject(*o.right);
        REQUIRE(n);
        *o.right += right_lens.fx * decentring_shift(*n, calibrated.right_decentring);
      }
      seen->now.emplace(o.id, o);
    }
    const int64_t t_us = 100'000 * (i + 1);
    if (!stereo || calibrated.wheels)
      tracker.speed({t_us, SpeedSource::kWheels, kStep / 0.1 + speed_noise(random), kSpeedSigma, 0.0});
    const TrackedFrame& out = tracker.process({t_us, image, stereo && i < calibrated.right_until ? image : cv::Mat()});
    const Odometry& o = out.odometry;
    if (o.validity != Validity::kValid) continue;
    ++result.valid;
    if (!T_local_enu) T_local_enu = o.T_frame_vehicle * T_enu_vehicle.inverse();
    const Vector6d e = local(o.T_frame_vehicle, *T_local_enu * T_enu_vehicle);
    result.nees = e.dot(o.cov_pose.ldlt().solve(e)) / 6.0;
    const Eigen::Matrix3d R = o.T_frame_vehicle.R();
    const Eigen::Vector3d p = R.transpose() * e.head<3>();
    result.passed.push_back({{p.x(), p.y(), e(5)},
                             seen_from_above(out.cov_image, R),
                             seen_from_above(out.cov_map, R),
                             o.T_frame_vehicle,
                             o.cov_pose - out.cov_image - out.cov_map - out.considered * out.considered.transpose()});
    result.error = e.head<3>().norm();
    if (i <= kStraight) T_local_straight = o.T_frame_vehicle;
    result.last_way = (o.T_frame_vehicle.p - T_local_straight.p).norm() / (kStep * std::max(1, i - kStraight));
    result.sigma = std::sqrt(o.cov_pose.topLeftCorner<3, 3>().trace());
  }
  return result;
}

struct Drives {
  double nees = 0.0, error = 0.0, sigma = 0.0;  ///< mean, and two medians
};

template <class CalibratedOf>
Drives drives_of(int count, bool stereo, double noise_px, const CalibratedOf& calibrated_of) {
  Drives all;
  std::vector<double> errors, sigmas;
  for (int seed = 1; seed <= count; ++seed) {
    const Drive one = drive(static_cast<uint64_t>(seed), stereo, noise_px, calibrated_of(seed));
    CHECK(one.valid >= kFrames - 10);
    all.nees += one.nees / count;
    errors.push_back(one.error);
    sigmas.push_back(one.sigma);
  }
  std::sort(errors.begin(), errors.end());
  std::sort(sigmas.begin(), sigmas.end());
  all.error = errors[errors.size() / 2];
  all.sigma = sigmas[sigmas.size() / 2];
  return all;
}

Drives drives(int count, bool stereo, double noise_px, const Calibrated& calibrated = {}) {
  return drives_of(count, stereo, noise_px, [&](int) { return calibrated; });
}

TEST_CASE("the covariance is consistent with the errors at any noise", "[statistics]") {
  double mean = 0.0;
  for (const bool stereo : {true, false}) {
    for (const double noise_px : {0.3, 0.6}) {
      const Drives d = drives(20, stereo, noise_px);
      // Read by scripts/figures.d/keyframe_tracker.py.
      std::printf("nees %s %.1f px: %.3f, median error %.3f m, median sigma %.3f m\n", stereo ? "stereo" : "mono",
                  noise_px, d.nees, d.error, d.sigma);
      CHECK(d.nees > 0.6);  // three sigmas of the mean of 20 drives
      CHECK(d.nees < 1.4);
      mean += 0.25 * d.nees;
    }
  }
  CHECK(mean > 0.7);
  CHECK(mean < 1.5);
}

TEST_CASE("systematic calibration errors are contained in the covariance", "[statistics]") {
  const ScaleSigmas sigmas = CameraRig{}.scale_sigmas;
  const auto drawn = [](const ScaleSigmas& sizes, const ScaleSigmas& configured) {
    return [=](int seed) {
      std::mt19937 random(static_cast<unsigned>(1000 + seed));
      std::normal_distribution<double> normal;
      Calibrated calibrated;
      calibrated.scale_error = sizes.length * normal(random);
      calibrated.focal_error = sizes.rotation * normal(random);
      calibrated.scale_sigmas = configured;
      return calibrated;
    };
  };
  constexpr int kDrives = 10;
  const auto test = [&](const char* what, const ScaleSigmas& sizes, const ScaleSigmas& configured) {
    const Drives d = drives_of(kDrives, true, 0.3, drawn(sizes, configured));
    std::printf("calibration drawn, %s: nees %.2f, median error %.3f m, median sigma %.3f m\n", what, d.nees, d.error,
                d.sigma);
    return d.nees;
  };
  const double nees = test("configured", sigmas, sigmas);
  CHECK(nees > 0.5);
  CHECK(nees < 1.7);
  // Teeth: the same errors with one of the two not configured.
  CHECK(test("length scale not configured", {sigmas.length, 0.0}, {0.0, sigmas.rotation}) > 50.0);
  const double turns = 2.0 * sigmas.rotation;
  CHECK(test("rotation scale configured", {0.0, turns}, {sigmas.length, turns}) < 1.7);
  CHECK(test("rotation scale not configured", {0.0, turns}, {sigmas.length, 0.0}) > 2.0);
}

TEST_CASE("a turn that all tracks pretend is contained in the covariance", "[statistics]") {
  constexpr double kDrift = 5.0e-5;  // rad/m, more than pictures have: the drives are short
  const auto nees = [&](double configured, FrontEndKind kind = FrontEndKind::kKlt) {
    const auto drawn = [=](int seed) {
      std::mt19937 random(static_cast<unsigned>(2000 + seed));
      std::normal_distribution<double> normal;
      Calibrated calibrated;
      calibrated.turn_radpm = {kDrift * normal(random), 0.0, kDrift * normal(random)};
      calibrated.drift_radpm = configured;
      calibrated.kind = kind;
      return calibrated;
    };
    const Drives d = drives_of(10, false, 0.3, drawn);
    std::printf("a pretended turn, %.0e rad/m configured: nees %.2f\n", configured, d.nees);
    return d.nees;
  };
  const double claimed = nees(kDrift);
  CHECK(claimed > 0.5);
  CHECK(claimed < 1.7);
  CHECK(nees(0.0) > 3.0);  // teeth
  // Keypoints of ORB pretend twice as much as is configured.
  CHECK(nees(0.5 * kDrift, FrontEndKind::kOrb) == claimed);
}

/// What accumulates from one image to a later one, in the later one's axes.
Eigen::Matrix3d grown(const Passed& from, const Passed& to) {
  const SE3 way = from.T_local_vehicle.inverse() * to.T_local_vehicle;
  const Matrix6d F = pose_transport_jacobian(from.T_local_vehicle, way);
  return seen_from_above(to.added - F * from.added * F.transpose(), to.T_local_vehicle.R());
}

/// Per degree of freedom, the squared error that does not accumulate (relative to the mean of two seconds around it,
/// with its trend) over its covariance: `configured` for one image, and a twelfth of what accumulates in that time, by
/// which the middle of a random walk is off its mean.
template <class Told>
double passing_nees(bool stereo, double noise_px, const Told& configured) {
  constexpr int kDrives = 10, kAround = 10;  // images before and after
  double sum = 0.0;
  int count = 0;
  for (int seed = 1; seed <= kDrives; ++seed) {
    const std::vector<Passed> passed = drive(static_cast<uint64_t>(seed), stereo, noise_px, {}).passed;
    for (size_t i = 2 * kAround; i + kAround < passed.size(); ++i) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (size_t k = i - kAround; k <= i + kAround; ++k) mean += passed[k].error / (2 * kAround + 1);
      const Eigen::Vector3d e = passed[i].error - mean;
      const Eigen::Matrix3d claimed = configured(passed[i]) + grown(passed[i - kAround], passed[i + kAround]) / 12.0;
      sum += e.dot(claimed.ldlt().solve(e)) / 3.0;
      ++count;
    }
  }
  return sum / count;
}

TEST_CASE("the covariance of image and map errors that do not accumulate is consistent", "[statistics]") {
  const auto all = [](const Passed& p) -> Eigen::Matrix3d { return p.image + p.map; };
  const auto image = [](const Passed& p) -> Eigen::Matrix3d { return p.image; };
  const auto constant = [](const Passed&) -> Eigen::Matrix3d {
    return Eigen::Vector3d(0.005, 0.005, 1e-3).cwiseAbs2().asDiagonal();
  };
  std::vector<double> constants;
  for (const bool stereo : {true, false}) {
    for (const double noise_px : {0.15, 0.6}) {
      const double nees = passing_nees(stereo, noise_px, all), without_map = passing_nees(stereo, noise_px, image);
      constants.push_back(passing_nees(stereo, noise_px, constant));
      std::printf("passing, %s %.2f px: nees %.2f, of the picture alone %.2f, of constants %.2f\n",
                  stereo ? "stereo" : "mono", noise_px, nees, without_map, constants.back());
      CHECK(nees > 0.5);
      CHECK(nees < 2.0);
      CHECK(without_map > 1.5 * nees);  // teeth
    }
  }
}

TEST_CASE("a right image shifted by a third of a pixel is estimated from motion") {
  const double sigma_deg = KeyframeTrackerConfig{}.right_turn_std_deg;
  for (const double shift_px : {-0.3, 0.3}) {
    const Drives exact = drives(3, true, 0.3),
                 learnt = drives(3, true, 0.3, {.right_shift_px = shift_px, .right_turn_std_deg = sigma_deg}),
                 believed = drives(3, true, 0.3, {.right_shift_px = shift_px});
    std::printf("right picture %+.1f px off: error %.3f m, %.3f m where the calibration is believed, %.3f m without\n",
                shift_px, learnt.error, believed.error, exact.error);
    CHECK(learnt.error < 0.25 * believed.error);  // teeth: the same drive with the calibration fixed
    CHECK(believed.error > 1.0);
  }
}

TEST_CASE("what a calibration leaves of the right lens's decentring is estimated") {
  const Eigen::Vector2d p(-0.008, 0.0005);  // like KITTI's of 3 October 2011
  const double sigma_deg = KeyframeTrackerConfig{}.right_turn_std_deg;
  const auto error = [&](const Eigen::Vector2d& decentring, double sigma) {
    return drives(3, true, 0.3,
                  {.right_turn_std_deg = sigma_deg, .right_decentring = decentring, .right_decentring_std = sigma})
        .error;
  };
  const double sigma = KeyframeTrackerConfig{}.right_decentring_std;
  const double exact = error(Eigen::Vector2d::Zero(), sigma), learnt = error(p, sigma), believed = error(p, 0.0);
  std::printf("right lens off its axis: error %.3f m, %.3f m where the calibration is believed, %.3f m without\n",
              learnt, believed, exact);
  CHECK(learnt < 0.5 * believed);  // teeth: the same drive without it
  CHECK(learnt < 2.0 * exact);
}

TEST_CASE("stereo that loses its right camera before a bend keeps its scale") {
  const Calibrated configured{.focal_error = 0.02,
                              .scale_sigmas = CameraRig{}.scale_sigmas,
                              .focal_std = 0.01,
                              .right_until = 30,
                              .sharpness = 2.0};
  Calibrated believed = configured, wheels = configured, both = configured;
  believed.focal_std = 0.0;
  wheels.wheels = true;
  both.right_until = kFrames;
  const auto stretch = [](const Calibrated& calibrated) {
    double sum = 0.0;
    for (const uint64_t seed : {1U, 7U, 8U}) {  // the sharpest bends
      sum += std::abs(drive(seed, true, 0.3, calibrated).last_way - 1.0) / 3.0;
    }
    return sum;
  };
  const double with_both = stretch(both), learnt = stretch(configured), by_wheels = stretch(wheels);
  const double as_told = stretch(believed);
  std::printf(
      "right eye lost, focal length 2 %% off: lengths %.4f off after the bend, %.4f with wheels; %.4f with the lens "
      "believed, %.4f with both eyes\n",
      learnt, by_wheels, as_told, with_both);
  CHECK(learnt < 0.5 * as_told);
  CHECK(by_wheels < 0.2 * as_told);
}

}  // namespace
}  // namespace roadfix
