/// Runs the keyframe tracker over a folder in KITTI's odometry layout and prints error and cost.
///   keyframe_tracker_bench FOLDER [--mono] [--first N] [--count N] [--from N] [--set KEY=VALUE] [--weights FILE]
///                          [--mirror] [--reverse] [--every N]
/// KEY is one of the tracker's configuration, for example kind=orb; FILE the network of kind=superpoint.
/// Copies of the clip: --mirror swaps left and right, eyes included; --reverse drives backwards; --every takes each Nth frame.
/// CPU is the whole process's, all threads, from before the first frame to after the last; pictures are decoded outside
/// of it and their cost is printed apart.
#include <sys/resource.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <stdexcept>

#include "evaluation/alignment.h"
#include "geometry/determinism.h"
#include "program.h"
#include "setter.h"
#include "slam/keyframe_tracker.h"

namespace roadfix {
namespace {

using bench::cpu_ms;

struct Sequence {
  CameraRig rig;
  std::vector<int64_t> t_us;
  std::vector<SE3> reference;
};

struct Copy {
  bool mirror = false, reverse = false;
  int every = 1;
};

cv::Mat read(const std::filesystem::path& file, bool mirror) {
  cv::Mat picture = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  if (mirror && !picture.empty()) cv::flip(picture, picture, 1);
  return picture;
}

Sequence load(const std::filesystem::path& folder, bool mono, bool mirror) {
  Sequence s;
  std::map<std::string, std::vector<double>> calibration;
  std::ifstream calib(folder / "calib.txt");
  for (std::string line; std::getline(calib, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    for (double value = 0; words >> value;) calibration[key].push_back(value);
  }
  const auto& p0 = calibration.at("P0:");
  const auto& p1 = calibration.at("P1:");
  s.rig.T_vehicle_left.q = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);  // a vehicle at the camera, which looks ahead
  s.rig.left.fx = s.rig.left.fy = p0.at(0);
  s.rig.left.cx = p0.at(2);
  s.rig.left.cy = p0.at(6);
  const cv::Mat picture = cv::imread((folder / "image_0" / "000000.png").string(), cv::IMREAD_GRAYSCALE);
  s.rig.left.width = picture.cols;
  s.rig.left.height = picture.rows;
  if (!mono) {
    s.rig.right = s.rig.left;
    s.rig.T_right_left.p.x() = p1.at(3) / p1.at(0);
  }
  if (mirror) s.rig.left.cx = s.rig.left.width - 1 - s.rig.left.cx;
  if (mirror && !mono) s.rig.right->cx = s.rig.left.cx;
  std::ifstream times(folder / "times.txt");
  for (double t = 0; times >> t;) s.t_us.push_back(std::llround(t * 1e6) + 1);
  std::ifstream poses(folder / "poses.txt");
  for (std::array<double, 12> T{}; poses >> T[0];) {
    for (size_t i = 1; i < 12; ++i) poses >> T[i];
    Eigen::Matrix3d R;
    R << T[0], T[1], T[2], T[4], T[5], T[6], T[8], T[9], T[10];
    s.reference.push_back({Eigen::Quaterniond(R), {T[3], T[7], T[11]}});
  }
  return s;
}

/// RMSE of positions after the best alignment of that kind.
double ate(const std::vector<PosePair>& pairs, Alignment alignment) {
  const auto S = align(pairs, alignment);
  if (!S) return std::nan("");
  if (alignment == Alignment::kSim3) std::printf("scale %.4f ", S->scale);
  double sum = 0.0;
  for (const PosePair& pair : pairs) {
    sum += (transformed(*S, pair.estimate).T_frame_vehicle.p - pair.reference.T_frame_vehicle.p).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

/// Median sigma of the position, m.
double median_sigma(const std::vector<PosePair>& pairs) {
  std::vector<double> sigmas;
  for (const PosePair& pair : pairs) {
    sigmas.push_back(std::sqrt(pair.estimate.cov_pose.topLeftCorner<3, 3>().trace()));
  }
  std::sort(sigmas.begin(), sigmas.end());
  return sigmas.empty() ? 0.0 : sigmas[sigmas.size() / 2];
}

int run(int argc, char** argv) {
  std::filesystem::path folder;
  bool mono = false, verbose = false;
  Copy copy;
  int first = 0, count = 100000, from = 16;
  KeyframeTrackerConfig config;
  std::vector<uint8_t> weights;
  for (int i = 1; i < argc; ++i) {
    const std::string a = argv[i];
    const auto value = [&] {
      return i + 1 < argc ? std::string(argv[++i]) : throw std::runtime_error(a + " needs a value");
    };
    if (a == "--mono")
      mono = true;
    else if (a == "--verbose")
      verbose = true;
    else if (a == "--mirror")
      copy.mirror = true;
    else if (a == "--reverse")
      copy.reverse = true;
    else if (a == "--every")
      copy.every = std::stoi(value());
    else if (a == "--first")
      first = std::stoi(value());
    else if (a == "--count")
      count = std::stoi(value());
    else if (a == "--from")
      from = std::stoi(value());
    else if (a == "--weights") {
      std::ifstream file(value(), std::ios::binary);
      weights.assign(std::istreambuf_iterator<char>(file), {});
    } else if (a == "--set") {
      bench::set_key(config, value());
    } else
      folder = a;
  }
  fix_eigen_blocking();
  fix_opencv_threads();
  const Sequence s = load(folder, mono, copy.mirror);
  InlineExecutor executor;
  KeyframeTracker tracker(config, s.rig, make_front_end(config.front_end, weights), executor);
  std::vector<PosePair> pairs;
  std::vector<double> cost;
  double decode = 0.0, inliers = 0.0, matches = 0.0;
  int valid = 0, frames = 0;
  const int end = std::min<int>(first + count, static_cast<int>(s.t_us.size()));
  for (int k = first; k < end; k += copy.every) {
    const int i = copy.reverse ? first + end - 1 - k : k;
    char name[32];
    std::snprintf(name, sizeof name, "%06d.png", i);
    const bool swap = copy.mirror && !mono;
    const auto left = folder / (swap ? "image_1" : "image_0") / name;
    const auto right = folder / (swap ? "image_0" : "image_1") / name;
    const int64_t t_us = s.t_us[static_cast<size_t>(i)];
    const double t0 = cpu_ms();
    CameraFrame frame{copy.reverse ? s.t_us.back() + 1 - t_us : t_us, read(left, copy.mirror), {}};
    if (!mono && std::filesystem::exists(right)) frame.right = read(right, copy.mirror);
    const double t1 = cpu_ms();
    const TrackedFrame& out = tracker.process(frame);
    const double t2 = cpu_ms();
    decode += t1 - t0;
    cost.push_back(t2 - t1);
    ++frames;
    const bool ok = out.odometry.validity != Validity::kInvalid;
    valid += ok ? 1 : 0;
    matches += out.num_expected > 0 ? static_cast<double>(out.num_matches) / out.num_expected : 0.0;
    inliers += out.num_landmarks_seen > 0 ? static_cast<double>(out.num_inliers) / out.num_landmarks_seen : 0.0;
    if (verbose)
      std::printf("%d state %d match %d/%d inl %d/%d rms %.3f kf %ld lm %ld cpu %.1f p %.3f %.3f %.3f sigma %.3f %s\n",
                  i, static_cast<int>(out.state), out.num_matches, out.num_expected, out.num_inliers,
                  out.num_landmarks_seen, out.rms_px, out.num_keyframes, out.num_landmarks, t2 - t1,
                  out.odometry.T_frame_vehicle.p.x(), out.odometry.T_frame_vehicle.p.y(),
                  out.odometry.T_frame_vehicle.p.z(), std::sqrt(out.odometry.cov_pose.topLeftCorner<3, 3>().trace()),
                  out.reason.c_str());
    if (ok && i >= from && static_cast<size_t>(i) < s.reference.size()) {
      pairs.push_back({out.odometry, {}});
      const SE3& T = s.reference[static_cast<size_t>(i)];
      Eigen::Vector3d& p = pairs.back().reference.T_frame_vehicle.p;
      p = swap ? T * Eigen::Vector3d(-s.rig.T_right_left.p) : T.p;
      if (copy.mirror) p.x() = -p.x();
    }
  }
  std::printf("lens %.4f %.4f %.5f %.5f %.5f ", tracker.lens().value(0), tracker.lens().value(1),
              tracker.lens().value(2), tracker.lens().value(3), tracker.lens().value(4));
  double total = 0.0;
  for (const double c : cost) total += c;
  std::sort(cost.begin(), cost.end());
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf(
      "valid %d/%d ate_se3 %.3f m ate_sim3 %.3f m cpu %.2f ms p99 %.2f ms (decode %.2f) matches %.3f inliers %.3f "
      "keyframes %ld sigma %.3f m rss %.0f MB\n",
      valid, frames, ate(pairs, Alignment::kSe3), ate(pairs, Alignment::kSim3), total / frames,
      cost[cost.size() * 99 / 100], decode / frames, matches / frames, inliers / frames, tracker.last().num_keyframes,
      median_sigma(pairs), static_cast<double>(usage.ru_maxrss) / 1024.0);
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("keyframe_tracker_bench", roadfix::run, argc, argv); }
