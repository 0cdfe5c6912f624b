/// By how much optical flow's places are off the truth on drawn pictures, along tracks: how errors grow with a track's
/// age, how they step from picture to picture, and whether they step to one side.
///   track_noise SCENARIO FIRST_SEED LAST_SEED [--size WIDTHxHEIGHT] [--from S] [--to S] [--shape-std X] [--window PX]
///               [--noise FACTOR] [--jpeg QUALITY] [--distortion FACTOR] [--perspective on|off]
/// Tracks are looked for where the true motion takes them. Prints tables; errors are of the left eye, in pixels, steps
/// seen along the flow, and outwards (away from the picture's middle); last the motion of the camera that the steps
/// look like. `--perspective off`: patches without features/perspective_bend.h.
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
  double noise_factor = 1.0, distortion_factor = 1.0;
  bool perspective = true;
  int jpeg_quality = 0;  ///< zero: the scenario's
  FrontEndConfig front_end{.max_features = 200};
};

struct Followed {
  Eigen::Vector3d p_enu;
  Eigen::Vector2d error = Eigen::Vector2d::Zero(),
                  place = Eigen::Vector2d::Zero();  ///< in the last picture; its true place
  double depth = 0.0;
  int age = 0;
  Eigen::Vector3d normal_enu = Eigen::Vector3d::Zero();  ///< of its surface: normal . (p - p_enu) = 0
};

struct Step {
  double flow = 0.0;                 ///< px, from the last picture
  double depth = 0.0;                ///< m
  double growth = 1.0;               ///< depth before over depth now
  double side = 0.0;                 ///< -1 at the left edge of the picture, 1 at the right one
  double along = 0.0, across = 0.0;  ///< of the error's change, against the flow's direction
  double outward = 0.0;              ///< of the error's change in u, away from the middle
  int age = 0;
  Eigen::Vector2d ray, change;  ///< its true place, normalised; of the error, px
  double pull = 0.0;            ///< along the flow, of an affine patch by its surface's second order
};

struct Results {
  std::vector<Step> steps;
  std::array<std::vector<double>, kAges> errors;                   ///< absolute, one coordinate each
  std::array<double, kAges> product{}, square{}, square_before{};  ///< with the picture before
  int lost = 0, judged = 0;
  double focal = 1.0;  ///< px
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

/// Of the surface under the pixel, in camera axes: inverse depth is linear in the ray on a plane.
Eigen::Vector3d normal_near(const Camera& camera, const LightField& light, const Eigen::Vector2f& pixel) {
  Eigen::Matrix3d rays;
  Eigen::Vector3d inverse_depths;
  const Eigen::Vector2f offsets[] = {{-1.5F, -1.0F}, {1.5F, -1.0F}, {0.0F, 1.5F}};
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector2f at = pixel + offsets[k];
    rays.row(k) = camera.unproject(at.cast<double>())->homogeneous();
    inverse_depths[k] = 1.0 / depth_between(light, at);
  }
  return rays.inverse() * inverse_depths;
}

cv::Mat as_sent(const GrayImage& picture, int quality) {
  const cv::Mat view(picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.pixels.data()));
  std::vector<std::uint8_t> file;
  cv::imencode(".jpg", view, file, {cv::IMWRITE_JPEG_QUALITY, quality});
  return cv::imdecode(file, cv::IMREAD_GRAYSCALE);
}

/// By how much the middle of an affine patch lies off its point's place, where the picture between the two views is
/// that of a plane: the mean of the second order over the window.
Eigen::Vector2d second_order(const SimulatedRig& rig, const View& view, const View& before, const Followed& t) {
  constexpr double kReach_px = 4.0, kMoment_px2 = (11.0 * 11.0 - 1.0) / 12.0;
  const Eigen::Vector3d eye = before.T_enu_camera.p;
  const auto at = [&](const Eigen::Vector2d& pixel) -> std::optional<Eigen::Vector2d> {
    const auto ray = rig.camera.unproject(pixel);
    if (!ray) return std::nullopt;
    const Eigen::Vector3d d = before.T_enu_camera.q * ray->homogeneous();
    const Eigen::Vector3d p = eye + d * (t.normal_enu.dot(t.p_enu - eye) / t.normal_enu.dot(d));
    return rig.camera.project(view.T_enu_camera.inverse() * p);
  };
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  const auto middle = at(t.place);
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = kReach_px * Eigen::Vector2d::Unit(k);
    const auto a = at(t.place - step), b = at(t.place + step);
    if (!a || !b || !middle) return Eigen::Vector2d::Constant(std::nan(""));
    sum += *a + *b - 2.0 * *middle;
  }
  return 0.5 * kMoment_px2 / (kReach_px * kReach_px) * sum;
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
                     ahead.x() * step.y() - ahead.y() * step.x(), side > 0 ? step.x() : -step.x(), t.age,
                     p.hnormalized(), step, second_order(rig, view, before, t).dot(ahead)});
  t.error = error;
  t.place = *truth;
  t.depth = p.z();
}

void drive(const Options& options, std::uint64_t seed, Results& results) {
  ScenarioConfig config = scenario(options.scenario);
  if (options.width > 0) config.camera = with_size(config.camera, options.width, options.height);
  if (config.camera.layout == CameraLayout::kNone) config.camera.layout = CameraLayout::kMono;
  config.camera.noise_factor *= options.noise_factor;
  config.camera.distortion *= options.distortion_factor;
  if (options.jpeg_quality > 0) config.camera.jpeg_quality = options.jpeg_quality;
  const SimulatedDrive drive = simulate(config, seed);
  const SimulatedRig rig = rig_of(drive);
  results.focal = rig.camera.focal();
  InlineExecutor executor;
  Film film(drive, executor);
  const auto front_end = make_front_end(options.front_end);
  if (options.perspective)
    front_end->set_camera(rig.camera, rig.T_vehicle_left.q.conjugate() * Eigen::Vector3d::UnitX());
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
      const Eigen::Vector3d normal = normal_near(rig.camera, film.light(CameraSide::kLeft), f.pixel);
      next[f.track] = {view.T_enu_camera * Eigen::Vector3d(depth * ray->homogeneous()),
                       {0, 0},
                       f.pixel.cast<double>(),
                       depth,
                       0,
                       view.T_enu_camera.q * normal};
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

/// The camera's motion per picture that the steps look like: rotation about its axes and translation, with sigmas, by
/// least squares with Cauchy's weights.
void print_motion(const std::vector<Step>& steps, double focal) {
  constexpr double kKnee_px = 0.15, kFarthest_m = 60.0, kPictures = 300.0;
  constexpr int kRounds = 15;
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Eigen::Matrix<double, 6, 6> H;
  Vector6 motion = Vector6::Zero();
  double weights = 0.0, squares = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    H.setZero();
    Vector6 b = Vector6::Zero();
    weights = squares = 0.0;
    for (const Step& s : steps) {
      if (s.depth > kFarthest_m) continue;
      const double x = s.ray.x(), y = s.ray.y(), near = 1.0 / s.depth;
      Eigen::Matrix<double, 2, 6> J;
      J << x * y, -(1.0 + x * x), y, -near, 0.0, x * near, 1.0 + y * y, -x * y, -x, 0.0, -near, y * near;
      J *= focal;
      const Eigen::Vector2d r = s.change - J * motion;
      for (int k = 0; k < 2; ++k) {
        const double w = round == 0 ? 1.0 : 1.0 / (1.0 + r(k) * r(k) / (kKnee_px * kKnee_px));
        H += w * J.row(k).transpose() * J.row(k);
        b += w * J.row(k).transpose() * r(k);
        weights += w;
        squares += w * w * r(k) * r(k);
      }
    }
    motion += H.ldlt().solve(b);
  }
  const Vector6 sigma = (H.inverse().diagonal() * squares / weights).cwiseSqrt();
  const double degrees = kPictures * 180.0 / M_PI;
  std::printf(
      "looks like, in 300 pictures: pitch up %.3f +- %.3f, yaw to the left %.3f +- %.3f deg; ahead %.3f +- %.3f mm a "
      "picture\n",
      degrees * motion(0), degrees * sigma(0), -degrees * motion(1), degrees * sigma(1), 1e3 * motion(5),
      1e3 * sigma(5));
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
  print_bins("second order, px", r.steps, {-0.1, -0.01, -0.002, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.5},
             [](const Step& s) { return s.pull; });
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
    } else if (key == "--perspective") {
      o.perspective = value != "off";
    } else if (key == "--noise") {
      o.noise_factor = std::stod(value);
    } else if (key == "--jpeg") {
      o.jpeg_quality = std::stoi(value);
    } else if (key == "--distortion") {
      o.distortion_factor = std::stod(value);
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
  print_motion(results.steps, results.focal);
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("track_noise", roadfix::run, argc, argv); }
