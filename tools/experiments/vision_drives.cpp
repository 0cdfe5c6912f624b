/// The keyframe tracker on drawn pictures, held against the truth: what its motion over a stretch loses.
///   vision_drives SCENARIO FIRST_SEED LAST_SEED [--size WIDTHxHEIGHT] [--stereo] [--from S] [--to S]
///                 [--perspective on|off|both] [--rate HZ] [--duration S] [--set KEY=VALUE] [--weights FILE]
///                 [--right-turn YAW,PITCH,ROLL] [--laps]
/// Lengths are those of the drive's wheels without their scale error. `off`: affine patches without the correction of their second order
/// (features/perspective_bend.h). Prints, per seed, yaw (positive: turned too far to the left), pitch, across and
/// along, each estimate minus truth over the whole stretch, and the share of pictures with a pose; then means with
/// standard errors, and the NEES of relative poses over 5 s, 30 s and the stretch, rotation and translation apart, the
/// 5 and 30 s by axis too, with the root mean squares of error and sigma. --right-turn: what the right camera's calibration
/// has wrong, deg. --laps: horizontal error on the second lap, of the pose and of the one with all loops closed, each aligned
/// in yaw and place over the whole drive, and each tied to the truth at its first pose. KEY is one of the tracker's configuration, for example kind=orb; FILE the network of kind=superpoint.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "features/front_end.h"
#include "geometry/determinism.h"
#include "program.h"
#include "relative_motion.h"
#include "second_lap.h"
#include "setter.h"
#include "simulation/scenarios.h"
#include "simulation/scene/film.h"
#include "slam/keyframe_tracker.h"
#include "stream/executor.h"

namespace roadfix {
namespace {

/// Of relative poses; the longer ones overlap.
struct Window {
  const char* name;
  int64_t length_us, step_us;
};
constexpr std::array<Window, 2> kWindows{{{"5 s", 5'000'000, 5'000'000}, {"30 s", 30'000'000, 5'000'000}}};
constexpr double kWheelNoise = 0.03;
constexpr int64_t kSettle_us = 4'000'000;  ///< from the first picture to the stretch's begin

struct Options {
  std::string scenario;
  int first = 1, last = 1;
  int width = 0, height = 0;
  bool stereo = false, laps = false;
  double from_s = 0.0, to_s = 1e9;
  double rate_hz = 0.0, duration_s = 0.0;                    ///< zero: the scenario's
  Eigen::Vector3d right_turn_deg = Eigen::Vector3d::Zero();  ///< yaw, pitch, roll
  std::string perspective = "on";
  KeyframeTrackerConfig tracker;
  std::vector<std::uint8_t> weights;
};

/// A front end that is not told of the lens: patches without the correction.
class WithoutLens final : public FrontEnd {
 public:
  explicit WithoutLens(std::unique_ptr<FrontEnd> inner) : inner_(std::move(inner)) {}
  std::vector<Feature> track(const cv::Mat& gray, std::span<const Feature> predictions) override {
    return inner_->track(gray, predictions);
  }
  std::vector<Feature> replenish() override { return inner_->replenish(); }
  void drop(std::span<const int64_t> tracks) override { inner_->drop(tracks); }
  void reset() override { inner_->reset(); }
  void save(StateWriter& writer) const override { inner_->save(writer); }
  void load(StateReader& reader) override { inner_->load(reader); }
  [[nodiscard]] int num_expected() const override { return inner_->num_expected(); }

 private:
  std::unique_ptr<FrontEnd> inner_;
};

class Run {
 public:
  Run(const Options& options, const SimulatedDrive& drive, const SimulatedRig& rig, bool perspective)
      : drive_(drive),
        tracker_(options.tracker, rig_for(options, drive, rig), front_end(options, perspective), executor_) {}

  void speed(const WheelSample& w) {
    double mean = 0.0;
    const int first = w.num_speeds == 4 ? 2 : 0;  // the rear axle
    for (int k = first; k < w.num_speeds; ++k) {
      const auto wheel = static_cast<size_t>(k);
      mean += w.speeds[wheel] / (1.0 + drive_.errors.wheel_scale[wheel]) / (w.num_speeds - first);
    }
    tracker_.speed({w.t_us, SpeedSource::kWheels, mean, kWheelNoise, 0.0});
  }

  void process(int64_t t_us, const cv::Mat& left, const cv::Mat& right) {
    const TrackedFrame& out = tracker_.process({t_us, left, right});
    ++pictures;
    if (out.odometry.validity != Validity::kValid) return;
    poses.push_back({t_us, out.reset_counter, out.odometry.T_frame_vehicle, drive_.truth_at(t_us).T_frame_vehicle,
                     tracker_.closed(out.odometry).T_frame_vehicle, out.odometry.cov_pose, out.cov_image, out.cov_map,
                     out.considered});
    resets = out.reset_counter;
    loops = out.num_loops;
  }

  [[nodiscard]] const LensCorrection& lens() const { return tracker_.lens(); }

  std::vector<Stamped> poses;
  int resets = 0, pictures = 0, loops = 0;

 private:
  static CameraRig rig_for(const Options& options, const SimulatedDrive& drive, const SimulatedRig& rig) {
    CameraRig r;
    r.left = rig.camera.intrinsics();
    r.T_vehicle_left = rig.T_vehicle_left;
    if (!options.stereo) return r;
    r.right = r.left;
    const Eigen::Vector3d turn = options.right_turn_deg * M_PI / 180.0;  // camera axes: x right, y down, z ahead
    r.T_right_left = SE3{exp_q(Eigen::Vector3d(turn.y(), turn.x(), turn.z())), Eigen::Vector3d::Zero()} *
                     T_left_right(drive.config.camera).inverse();
    r.scale_sigmas = {};
    return r;
  }
  static std::unique_ptr<FrontEnd> front_end(const Options& options, bool perspective) {
    auto made = make_front_end(options.tracker.front_end, options.weights);
    if (perspective) return made;
    return std::make_unique<WithoutLens>(std::move(made));
  }

  const SimulatedDrive& drive_;
  InlineExecutor executor_;
  KeyframeTracker tracker_;
};

cv::Mat as_sent(const GrayImage& picture, int quality) {
  const cv::Mat view(picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.pixels.data()));
  std::vector<std::uint8_t> file;
  cv::imencode(".jpg", view, file, {cv::IMWRITE_JPEG_QUALITY, quality});
  return cv::imdecode(file, cv::IMREAD_GRAYSCALE);
}

struct Totals {
  struct Relative {
    double place = 0.0, turn = 0.0;  ///< sums of NEES
    Vector6d square = Vector6d::Zero(), variance = Vector6d::Zero();
    int count = 0;

    void add(const Loss& l) {
      place += l.nees_place;
      turn += l.nees_turn;
      square += l.error.cwiseAbs2();
      variance += l.variance;
      ++count;
    }
  };
  std::vector<Vector6d> errors;
  std::array<Relative, kWindows.size()> windows;
  Relative stretch;
  int64_t poses = 0, pictures = 0;
  SecondLap laps;
};

double degrees(double rad) { return rad * 180.0 / M_PI; }

void add(const char* name, int seed, const Run& run, const Options& options, int64_t start_us, Totals& totals) {
  const auto from = start_us + static_cast<int64_t>(options.from_s * 1e6);
  std::vector<Stamped> poses;
  for (const Stamped& s : run.poses)
    if (s.t_us >= from) poses.push_back(s);
  if (poses.size() < 2) {
    std::printf("%-4s seed %d: no poses\n", name, seed);
    return;
  }
  const Loss all = loss(poses.front(), poses.back());
  totals.errors.push_back(all.error);
  totals.stretch.add(all);
  totals.poses += static_cast<int64_t>(run.poses.size());
  totals.pictures += run.pictures;
  for (size_t w = 0; w < kWindows.size(); ++w) {
    for (size_t i = 0, j = 0; i < poses.size();) {
      while (j < poses.size() && poses[j].t_us - poses[i].t_us < kWindows[w].length_us) ++j;
      if (j == poses.size()) break;
      if (poses[j].reset == poses[i].reset) totals.windows[w].add(loss(poses[i], poses[j]));
      for (const int64_t t_us = poses[i].t_us; i < poses.size() && poses[i].t_us - t_us < kWindows[w].step_us;) ++i;
    }
  }
  const Vector6d& e = all.error;
  std::printf(
      "%-4s seed %d: yaw %+.3f pitch %+.3f roll %+.3f deg, along %+.3f across %+.3f m, NEES place %.2f turn %.2f, %zu "
      "poses of %d, %d resets\n",
      name, seed, degrees(e(5)), degrees(e(4)), degrees(e(3)), e(0), e(1), all.nees_place, all.nees_turn,
      run.poses.size(), run.pictures, run.resets);
  if (options.laps) {
    const size_t second = second_lap(poses), count = poses.size() - second;
    SecondLap lap{count, {}, {}};
    for (const bool tied : {false, true}) {
      lap.open[tied] = squares_from(poses, second, &Stamped::T_found, tied);
      lap.closed[tied] = squares_from(poses, second, &Stamped::T_closed, tied);
    }
    std::printf("%-4s seed %d: %d loops, ", name, seed, run.loops);
    print(lap);
    totals.laps.add(lap);
  }
  if (options.stereo) {
    const Eigen::Vector3d turn = run.lens().value.segment<3>(LensCorrection::kRightRotation) * 180.0 / M_PI;
    std::printf("%-4s seed %d: right camera turned by yaw %+.4f pitch %+.4f roll %+.4f deg\n", name, seed, turn.y(),
                turn.x(), turn.z());
  }
  std::fflush(stdout);
}

void print(const char* name, const Totals& t) {
  const auto n = static_cast<double>(t.errors.size());
  if (t.pictures > 0)
    std::printf("%-4s tracked %.4f\n", name, static_cast<double>(t.poses) / static_cast<double>(t.pictures));
  if (t.laps.poses > 0) {
    std::printf("%-4s pooled: ", name);
    print(t.laps);
  }
  if (t.errors.size() < 2) return;
  Vector6d mean = Vector6d::Zero(), square = Vector6d::Zero();
  for (const Vector6d& e : t.errors) mean += e / n;
  for (const Vector6d& e : t.errors) square += (e - mean).cwiseAbs2() / (n - 1.0);
  const Vector6d error = (square / n).cwiseSqrt();
  std::printf(
      "%-4s mean of %.0f: yaw %+.3f +- %.3f deg, pitch %+.3f +- %.3f, along %+.3f +- %.3f m, across %+.3f +- %.3f; rms "
      "yaw %.3f\n",
      name, n, degrees(mean(5)), degrees(error(5)), degrees(mean(4)), degrees(error(4)), mean(0), error(0), mean(1),
      error(1), degrees(std::sqrt(square(5) + mean(5) * mean(5))));
  const auto relative = [&](const char* what, const Totals::Relative& r) {
    if (r.count == 0) return;
    std::printf("%-4s NEES over %s: place %.2f turn %.2f (%d windows); rms error / sigma:", name, what,
                r.place / r.count, r.turn / r.count, r.count);
    constexpr std::array<const char*, 6> kAxes{"along", "across", "up", "roll", "pitch", "yaw"};
    for (int k = 0; k < 6; ++k) {
      const double unit = k < 3 ? 1.0 : 180.0 / M_PI;
      std::printf(" %s %.4f/%.4f", kAxes[static_cast<size_t>(k)], unit * std::sqrt(r.square(k) / r.count),
                  unit * std::sqrt(r.variance(k) / r.count));
    }
    std::printf("\n");
  };
  for (size_t w = 0; w < kWindows.size(); ++w) relative(kWindows[w].name, t.windows[w]);
  relative("the stretch", t.stretch);
}

void drive(const Options& options, int seed, std::vector<Totals>& totals) {
  ScenarioConfig config = scenario(options.scenario);
  if (options.width > 0) config.camera = with_size(config.camera, options.width, options.height);
  if (options.rate_hz > 0.0) config.camera.rate_hz = options.rate_hz;
  if (options.duration_s > 0.0) config.duration_s = options.duration_s;
  config.camera.layout = options.stereo ? CameraLayout::kStereo : CameraLayout::kMono;
  const SimulatedDrive drive = simulate(config, static_cast<std::uint64_t>(seed));
  const SimulatedRig rig = rig_of(drive);
  InlineExecutor executor;
  Film film(drive, executor);
  std::vector<std::unique_ptr<Run>> runs;
  if (options.perspective != "off") runs.push_back(std::make_unique<Run>(options, drive, rig, true));
  if (options.perspective != "on") runs.push_back(std::make_unique<Run>(options, drive, rig, false));
  const int64_t start_us = drive.exposures.front();
  const auto begin = start_us + std::max<int64_t>(0, static_cast<int64_t>(options.from_s * 1e6) - kSettle_us);
  while (film.next_us() && *film.next_us() < begin) film.skip();
  auto wheel = drive.wheels.begin();
  while (film.advance()) {
    const int64_t t_us = drive.exposures[film.taken()];
    if (static_cast<double>(t_us - start_us) > options.to_s * 1e6) break;
    for (; wheel != drive.wheels.end() && wheel->t_us <= t_us; ++wheel)
      for (auto& run : runs) run->speed(*wheel);
    const cv::Mat left = as_sent(film.picture(CameraSide::kLeft, {}), config.camera.jpeg_quality);
    const cv::Mat right =
        options.stereo ? as_sent(film.picture(CameraSide::kRight, {}), config.camera.jpeg_quality) : cv::Mat();
    for (auto& run : runs) run->process(t_us, left, right);
  }
  for (size_t k = 0; k < runs.size(); ++k)
    add(options.perspective == "off" || k == 1 ? "off" : "on", seed, *runs[k], options, start_us, totals[k]);
}

Options parse(int argc, char** argv) {
  if (argc < 4) throw std::invalid_argument("usage: vision_drives SCENARIO FIRST_SEED LAST_SEED [options]");
  Options o;
  o.scenario = argv[1];
  o.first = std::stoi(argv[2]);
  o.last = std::stoi(argv[3]);
  for (int i = 4; i < argc; ++i) {
    const std::string key = argv[i];
    if (key == "--stereo" || key == "--laps") {
      (key == "--stereo" ? o.stereo : o.laps) = true;
      continue;
    }
    if (++i == argc) throw std::invalid_argument(key + " needs a value");
    const std::string value = argv[i];
    if (key == "--size") {
      if (std::sscanf(value.c_str(), "%dx%d", &o.width, &o.height) != 2)
        throw std::invalid_argument("--size: WIDTHxHEIGHT");
    } else if (key == "--from") {
      o.from_s = std::stod(value);
    } else if (key == "--to") {
      o.to_s = std::stod(value);
    } else if (key == "--rate") {
      o.rate_hz = std::stod(value);
    } else if (key == "--duration") {
      o.duration_s = std::stod(value);
    } else if (key == "--right-turn") {
      Eigen::Vector3d& turn = o.right_turn_deg;
      if (std::sscanf(value.c_str(), "%lf,%lf,%lf", &turn.x(), &turn.y(), &turn.z()) != 3)
        throw std::invalid_argument("--right-turn: YAW,PITCH,ROLL");
    } else if (key == "--set") {
      bench::set_key(o.tracker, value);
    } else if (key == "--weights") {
      std::ifstream file(value, std::ios::binary);
      o.weights.assign(std::istreambuf_iterator<char>(file), {});
    } else if (key == "--perspective") {
      if (value != "on" && value != "off" && value != "both")
        throw std::invalid_argument("--perspective: on, off, both");
      o.perspective = value;
    } else {
      throw std::invalid_argument("unknown option " + key);
    }
  }
  return o;
}

int run(int argc, char** argv) {
  fix_eigen_blocking();
  fix_opencv_threads();
  const Options options = parse(argc, argv);
  std::vector<Totals> totals(2);
  for (int seed = options.first; seed <= options.last; ++seed) drive(options, seed, totals);
  print(options.perspective == "off" ? "off" : "on", totals[0]);
  print("off", totals[1]);
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("vision_drives", roadfix::run, argc, argv); }
