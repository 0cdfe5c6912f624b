/// By how much optical flow's places are off the truth on drawn pictures, along tracks: how errors grow with a track's
/// age, how they step from picture to picture, and whether they step to one side.
///   track_noise SCENARIO FIRST_SEED LAST_SEED [--size WIDTHxHEIGHT] [--from S] [--to S] [--shape-std X] [--window PX]
/// Tracks are looked for where the true motion takes them. Prints tables; errors are of the left eye, in pixels, steps
/// seen along the flow, and outwards (away from the picture's middle).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "features/front_end.h"
#include "geometry/determinism.h"
#include "program.h"
#include "simulation/scenarios.h"
#include "simulation/scene/film.h"
#include "stream/executor.h"

namespace roadfix {
namespace {

constexpr double kLost_px = 4.0;     // farther off it follows something else
constexpr double kEdgeShare = 0.03;  // change of depth within two pixels that makes a place an edge
constexpr int kEdge_px = 2;
constexpr int kAges = 13;

struct Options {
  std::string scenario;
  int first = 1, last = 1;
  int width = 0, height = 0;
  double from_s = 0.0, to_s = 1e9;
  FrontEndConfig front_end{.max_features = 200};
};

struct Followed {
  Eigen::Vector3d p_enu;
  Eigen::Vector2d error = Eigen::Vector2d::Zero(),
                  place = Eigen::Vector2d::Zero();  ///< in the last picture; its true place
  double depth = 0.0;
  int age = 0;
};

struct Step {
  double flow = 0.0;                 ///< px, from the last picture
  double depth = 0.0;                ///< m
  double growth = 1.0;               ///< depth before over depth now
  double side = 0.0;                 ///< -1 at the left edge of the picture, 1 at the right one
  double along = 0.0, across = 0.0;  ///< of the error's change, against the flow's direction
  double outward = 0.0;              ///< of the error's change in u, away from the middle
  int age = 0;
};

struct Results {
  std::vector<Step> steps;
  std::array<std::vector<double>, kAges> errors;                   ///< absolute, one coordinate each
  std::array<double, kAges> product{}, square{}, square_before{};  ///< with the picture before
  int lost = 0, judged = 0;
};

std::optional<double> surface_depth(const LightField& light, const Eigen::Vector2f& pixel) {
  const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
  if (u < kEdge_px || v < kEdge_px || u >= light.width - kEdge_px || v >= light.height - kEdge_px) return std::nullopt;
  const auto at = [&](int x, int y) {
    return static_cast<double>(light.depth[static_cast<size_t>(y * light.width + x)]);
  };
  const double here = at(u, v);
  for (int y = v - kEdge_px; y <= v + kEdge_px; ++y)
    for (int x = u - kEdge_px; x <= u + kEdge_px; ++x)
      if (!(std::abs(at(x, y) / here - 1.0) < kEdgeShare * kEdge_px)) return std::nullopt;
  return here;
}

/// The depth at the pixel itself: inverse depth is linear on a plane.
double depth_between(const LightField& light, const Eigen::Vector2f& pixel) {
  const auto u = static_cast<int>(pixel.x()), v = static_cast<int>(pixel.y());
  const double a = static_cast<double>(pixel.x()) - u, b = static_cast<double>(pixel.y()) - v;
  const auto inverse = [&](int x, int y) {
    return 1.0 / static_cast<double>(light.depth[static_cast<size_t>(y * light.width + x)]);
  };
  return 1.0 / ((1 - b) * ((1 - a) * inverse(u, v) + a * inverse(u + 1, v)) +
                b * ((1 - a) * inverse(u, v + 1) + a * inverse(u + 1, v + 1)));
}

cv::Mat as_sent(const GrayImage& picture, int quality) {
  const cv::Mat view(picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.pixels.data()));
  std::vector<std::uint8_t> file;
  cv::imencode(".jpg", view, file, {cv::IMWRITE_JPEG_QUALITY, quality});
  return cv::imdecode(file, cv::IMREAD_GRAYSCALE);
}

void learn(const SimulatedRig& rig, const View& view, const View& before, const Feature& f, Followed& t, Results& r) {
  const Eigen::Vector3d p = view.T_enu_camera.inverse() * t.p_enu;
  const auto truth = rig.camera.project(p);
  if (!truth) return;
  const Eigen::Vector2d error = f.pixel.cast<double>() - *truth;
  ++t.age;
  ++r.judged;
  if (!(error.norm() < kLost_px)) {
    ++r.lost;
    t.age = -1;
    return;
  }
  const auto age = static_cast<size_t>(std::min(t.age, kAges - 1));
  for (int k = 0; k < 2; ++k) {
    r.errors[age].push_back(std::abs(error(k)));
    r.product[age] += error(k) * t.error(k);
    r.square[age] += error(k) * error(k);
    r.square_before[age] += t.error(k) * t.error(k);
  }
  const Eigen::Vector2d flow = *truth - t.place;
  const Eigen::Vector2d step = error - t.error;
  const Eigen::Vector2d ahead = flow.norm() > 0.1 ? Eigen::Vector2d(flow.normalized()) : Eigen::Vector2d::UnitX();
  const double half = 0.5 * rig.camera.intrinsics().width;
  const double side = (truth->x() - rig.camera.intrinsics().cx) / half;
  r.steps.push_back({flow.norm(), p.z(), t.depth / p.z(), side, step.dot(ahead),
                     ahead.x() * step.y() - ahead.y() * step.x(), side > 0 ? step.x() : -step.x(), t.age});
  t.error = error;
  t.place = *truth;
  t.depth = p.z();
  (void)before;
}

void drive(const Options& options, std::uint64_t seed, Results& results) {
  ScenarioConfig config = scenario(options.scenario);
  if (options.width > 0) config.camera = with_size(config.camera, options.width, options.height);
  if (config.camera.layout == CameraLayout::kNone) config.camera.layout = CameraLayout::kMono;
  const SimulatedDrive drive = simulate(config, seed);
  const SimulatedRig rig = rig_of(drive);
  InlineExecutor executor;
  Film film(drive, executor);
  const auto front_end = make_front_end(options.front_end);
  std::map<std::int64_t, Followed> known;
  std::optional<View> before;
  while (film.advance()) {
    const std::int64_t t_us = drive.exposures[film.taken()];
    const double t_s = 1e-6 * static_cast<double>(t_us - drive.exposures.front());
    if (t_s < options.from_s) continue;
    if (t_s > options.to_s) break;
    const View view = view_at(drive, rig.T_vehicle_left, t_us);
    const cv::Mat picture = as_sent(film.picture(CameraSide::kLeft, {}), config.camera.jpeg_quality);
    std::vector<Feature> hints;
    for (const auto& [track, t] : known) {
      const auto pixel = rig.camera.project(view.T_enu_camera.inverse() * t.p_enu);
      if (pixel) hints.push_back({track, pixel->cast<float>()});
    }
    std::map<std::int64_t, Followed> next;
    std::vector<std::int64_t> lost;
    for (const Feature& f : front_end->track(picture, hints)) {
      const auto it = known.find(f.track);
      if (it == known.end()) continue;
      learn(rig, view, *before, f, it->second, results);
      if (it->second.age < 0)
        lost.push_back(f.track);
      else
        next.insert(*it);
    }
    front_end->drop(lost);
    for (const Feature& f : front_end->replenish()) {
      if (!surface_depth(film.light(CameraSide::kLeft), f.pixel)) continue;
      const auto ray = rig.camera.unproject(f.pixel.cast<double>());
      if (!ray) continue;
      const double depth = depth_between(film.light(CameraSide::kLeft), f.pixel);
      next[f.track] = {
          view.T_enu_camera * Eigen::Vector3d(depth * ray->homogeneous()), {0, 0}, f.pixel.cast<double>(), depth, 0};
    }
    known = std::move(next);
    before = view;
  }
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <class Of>
void print_bins(const char* name, const std::vector<Step>& steps, const std::vector<double>& bounds, const Of& of) {
  std::printf("%-22s %8s %8s %8s %9s %9s %9s\n", name, "steps", "|along|", "|across|", "along", "outward", "+-");
  for (size_t b = 0; b + 1 < bounds.size(); ++b) {
    std::vector<double> along, across;
    double mean = 0.0, outward = 0.0, square = 0.0;
    for (const Step& s : steps) {
      if (!(of(s) >= bounds[b] && of(s) < bounds[b + 1])) continue;
      along.push_back(std::abs(s.along));
      across.push_back(std::abs(s.across));
      mean += std::clamp(s.along, -1.0, 1.0);
      outward += std::clamp(s.outward, -1.0, 1.0);
      square += std::min(1.0, s.outward * s.outward);
    }
    const auto n = static_cast<double>(std::max<size_t>(1, along.size()));
    std::printf("%8.2f .. %-10.2f %8zu %8.3f %8.3f %9.4f %9.4f %9.4f\n", bounds[b], bounds[b + 1], along.size(),
                median(along), median(across), mean / n, outward / n, std::sqrt(square) / n);
  }
}

void print(const Results& r) {
  std::printf("judged %d, lost %d\n", r.judged, r.lost);
  std::printf("%-10s %8s %8s %8s %12s\n", "age", "places", "median", "rms", "correlation");
  for (size_t k = 1; k < kAges; ++k) {
    const auto n = static_cast<double>(std::max<size_t>(1, r.errors[k].size()));
    std::printf("%-10zu %8zu %8.3f %8.3f %12.2f\n", k, r.errors[k].size(), median(r.errors[k]),
                std::sqrt(r.square[k] / n), r.product[k] / std::sqrt(std::max(1e-9, r.square[k] * r.square_before[k])));
  }
  print_bins("flow, px", r.steps, {0, 1, 2, 5, 10, 20, 40, 80}, [](const Step& s) { return s.flow; });
  print_bins("growth", r.steps, {0.9, 0.999, 1.01, 1.02, 1.04, 1.08, 1.15, 1.3, 2.0},
             [](const Step& s) { return s.growth; });
  print_bins("depth, m", r.steps, {0, 4, 8, 16, 32, 64, 1000}, [](const Step& s) { return s.depth; });
  print_bins("age", r.steps, {1, 2, 3, 5, 9, 17, 1000}, [](const Step& s) { return static_cast<double>(s.age); });
  print_bins("side", r.steps, {-1, -0.6, -0.2, 0.2, 0.6, 1.0}, [](const Step& s) { return s.side; });
}

Options parse(int argc, char** argv) {
  if (argc < 4) throw std::invalid_argument("usage: track_noise SCENARIO FIRST_SEED LAST_SEED [options]");
  Options o{argv[1], std::stoi(argv[2]), std::stoi(argv[3])};
  for (int i = 4; i + 1 < argc; i += 2) {
    const std::string key = argv[i], value = argv[i + 1];
    if (key == "--size") {
      if (std::sscanf(value.c_str(), "%dx%d", &o.width, &o.height) != 2)
        throw std::invalid_argument("--size: WIDTHxHEIGHT");
    } else if (key == "--from") {
      o.from_s = std::stod(value);
    } else if (key == "--to") {
      o.to_s = std::stod(value);
    } else if (key == "--shape-std") {
      o.front_end.klt_shape_std = std::stod(value);
    } else if (key == "--window") {
      o.front_end.klt_window_px = std::stoi(value);
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
  Results results;
  for (int seed = options.first; seed <= options.last; ++seed)
    drive(options, static_cast<std::uint64_t>(seed), results);
  print(results);
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("track_noise", roadfix::run, argc, argv); }
