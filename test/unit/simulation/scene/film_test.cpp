// Pictures of whole drives: the same bytes again, light and dark where the street has it, and what faults do to them.
#include "simulation/scene/film.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "simulation/scenarios.h"
#include "stream/thread_pool.h"
#include "unit/simulation/scene/streets.h"

namespace roadfix {
namespace {

ScenarioConfig small(const char* name, double duration_s, double rate_hz, CameraLayout layout = CameraLayout::kMono) {
  ScenarioConfig c = scenario(name);
  c.duration_s = duration_s;
  c.camera = with_size(c.camera, 144, 64);
  c.camera.layout = layout;
  c.camera.rate_hz = rate_hz;
  return c;
}

struct Frame {
  double t_s;
  GrayImage left, right;
  Exposure exposure;
};

/// Every delivered picture, drawn.
std::vector<Frame> frames_of(const ScenarioConfig& config, std::uint64_t seed, int threads = 1) {
  const SimulatedDrive drive = simulate(config, seed);
  ThreadPool pool(threads);
  Film film(drive, pool);
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < drive.pictures_left.size(); ++i) {
    while (frames.empty() ? film.advance() : film.taken() < drive.pictures_left[i].exposure && film.advance()) {
      if (film.taken() == drive.pictures_left[i].exposure) break;
    }
    Frame f{seconds_between(config.start_utime, drive.exposures[film.taken()]), {}, {}, film.exposure()};
    f.left = film.picture(CameraSide::kLeft, drive.pictures_left[i].effects);
    if (!drive.pictures_right.empty()) f.right = film.picture(CameraSide::kRight, drive.pictures_right[i].effects);
    frames.push_back(std::move(f));
  }
  return frames;
}

double mean(const GrayImage& g) {
  double sum = 0.0;
  for (const auto x : g.pixels) sum += x;
  return sum / static_cast<double>(g.pixels.size());
}

/// Standard deviation of means over 8 by 8 px: structure that noise of single pixels cannot give.
double structure(const GrayImage& g) {
  double sum = 0.0;
  double squares = 0.0;
  int count = 0;
  for (int y = 0; y + 8 <= g.height; y += 8) {
    for (int x = 0; x + 8 <= g.width; x += 8) {
      double block = 0.0;
      for (int k = 0; k < 64; ++k) block += g.pixels[static_cast<std::size_t>((y + k / 8) * g.width + x + k % 8)];
      sum += block / 64.0;
      squares += block * block / 4096.0;
      ++count;
    }
  }
  return std::sqrt(std::max(0.0, squares / count - sum * sum / count / count));
}

TEST_CASE("a film is the same bytes again and with more threads, and others from another seed") {
  const auto bytes = [](std::uint64_t seed, int threads) {
    std::vector<std::uint8_t> all;
    for (const Frame& f : frames_of(small("city_loop", 6.0, 1.0, CameraLayout::kStereo), seed, threads)) {
      all.insert(all.end(), f.left.pixels.begin(), f.left.pixels.end());
      all.insert(all.end(), f.right.pixels.begin(), f.right.pixels.end());
    }
    return all;
  };
  const auto once = bytes(1, 1);
  CHECK(once.size() == 7U * 2U * 144U * 64U);
  CHECK(once == bytes(1, 3));
  CHECK(once != bytes(2, 1));
}

TEST_CASE("the right eye sees the left one's points shifted by the disparity") {
  const SimulatedDrive drive = simulate(small("city_loop", 10.0, 0.2, CameraLayout::kStereo), 3);
  const SimulatedRig rig = rig_of(drive);
  CHECK((rig.T_vehicle_left.inverse() * rig.T_vehicle_right).p.x() == Approx(0.54));
  InlineExecutor executor;
  Film film(drive, executor);
  for (int i = 0; i < 3; ++i) REQUIRE(film.advance());
  CHECK_FALSE(film.advance());
  const LightField& left = film.light(CameraSide::kLeft);
  const LightField& right = film.light(CameraSide::kRight);
  int same = 0;
  int all = 0;
  for (int v = 0; v < 64; ++v) {
    for (int u = 40; u < 144; ++u) {
      const float depth = left.depth[static_cast<std::size_t>(v * 144 + u)];
      if (!std::isfinite(depth)) continue;
      const double disparity = drive.config.camera.intrinsics_px[0] * 0.54 / depth;
      const auto x = static_cast<int>(std::lround(u - disparity));
      if (x < 0) continue;
      ++all;
      same += std::abs(right.depth[static_cast<std::size_t>(v * 144 + x)] - depth) < 0.05F * depth ? 1 : 0;
    }
  }
  CHECK(all > 2000);
  CHECK(same > 0.85 * all);  // the rest is hidden from one eye, or on an edge
}

TEST_CASE("a lit tunnel is lit, a dark one is dark, and its mouth dazzles") {
  const auto lit = frames_of(small("tunnel_lit", 165.0, 0.5), 1);
  const auto dark = frames_of(small("tunnel_dark", 165.0, 0.5), 1);
  const double day = lit[20].exposure.time_s * lit[20].exposure.gain;
  double brightest_exit = 0.0;
  double darkest_entry = 255.0;
  double adapted = 0.0;  // in the tunnel
  for (std::size_t i = 0; i < lit.size(); ++i) {
    const double t_s = lit[i].t_s;
    const double gathered = lit[i].exposure.time_s * lit[i].exposure.gain;
    CAPTURE(t_s, gathered / day, mean(lit[i].left), structure(lit[i].left), structure(dark[i].left));
    if (t_s > 90.0 && t_s < 96.0) darkest_entry = std::min(darkest_entry, mean(lit[i].left));
    if (t_s > 112.0 && t_s < 132.0) {  // deep inside, the exit not in sight
      CHECK(gathered > 8.0 * day);
      adapted = mean(lit[i].left);
      CHECK(mean(lit[i].left) > 80.0);
      CHECK(structure(lit[i].left) > 15.0);
      CHECK(structure(dark[i].left) < 4.0);
      CHECK(mean(dark[i].left) < 40.0);
    }
    if (t_s > 150.0) brightest_exit = std::max(brightest_exit, mean(lit[i].left));
    if (t_s < 40.0) CHECK(lit[i].left.pixels == dark[i].left.pixels);
    if (t_s > 20.0 && t_s < 50.0) CHECK(mean(lit[i].left) == Approx(115.0).margin(30.0));
    if (i > 0) {
      const double before = lit[i - 1].exposure.time_s * lit[i - 1].exposure.gain;
      CHECK(std::abs(std::log(gathered / before)) < std::log(1.3501));
    }
  }
  CHECK(darkest_entry < 0.8 * adapted);  // from the shade of the bridge, so by less than from the sun
  CHECK(brightest_exit > 200.0);
}

/// Frames with and without a fault from 3 s to 6 s, one a second.
struct Pair {
  std::vector<Frame> before, after;
};
Pair with_fault(const std::string& text) {
  ScenarioConfig config = small("city_loop", 8.0, 1.0, CameraLayout::kStereo);
  Pair p;
  p.before = frames_of(config, 1);
  config.faults.push_back(parse_fault(text));
  p.after = frames_of(config, 1);
  return p;
}

TEST_CASE("faults of the pictures do what they say, in their time, to their eye") {
  const auto check = [](const std::string& fault, bool right_too, auto&& changed) {
    CAPTURE(fault);
    const Pair p = with_fault(fault);
    REQUIRE(p.before.size() == 9);
    REQUIRE(p.after.size() == 9);
    for (std::size_t i = 0; i < 9; ++i) {
      const bool in = p.before[i].t_s >= 3.0 && p.before[i].t_s < 6.0;
      CAPTURE(p.before[i].t_s);
      CHECK(p.before[i].exposure.time_s == p.after[i].exposure.time_s);
      if (in) CHECK(changed(p.before[i].left, p.after[i].left));
      if (in && right_too) CHECK(changed(p.before[i].right, p.after[i].right));
      if (!in) CHECK(p.before[i].left.pixels == p.after[i].left.pixels);
      if (!in || !right_too) CHECK(p.before[i].right.pixels == p.after[i].right.pixels);
    }
  };
  check("camera.dark@3+3", true, [](const GrayImage& a, const GrayImage& b) { return mean(b) < 0.25 * mean(a); });
  check("camera.white@3+3:right=0", false, [](const GrayImage&, const GrayImage& b) {
    return std::all_of(b.pixels.begin(), b.pixels.end(), [](std::uint8_t g) { return g > 250; });
  });
  check("camera.occlude@3+3:share=0.5", true, [](const GrayImage& a, const GrayImage& b) {
    bool right_half_is_seen = true;
    double sum = 0.0;
    double squares = 0.0;
    for (int y = 0; y < a.height; ++y) {
      for (int x = 0; x < a.width; ++x) {
        const auto at = static_cast<std::size_t>(y * a.width + x);
        if (x >= a.width / 2) right_half_is_seen &= a.pixels[at] == b.pixels[at];
        if (x < 60) sum += b.pixels[at], squares += double(b.pixels[at]) * b.pixels[at];
      }
    }
    const double n = 60.0 * a.height;
    return right_half_is_seen && squares / n - sum * sum / n / n < 36.0;
  });
  check("camera.noise@3+3:factor=4", true, [](const GrayImage& a, const GrayImage& b) {
    double squares = 0.0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) squares += std::pow(double(a.pixels[i]) - b.pixels[i], 2);
    const double rms = std::sqrt(squares / static_cast<double>(a.pixels.size()));
    return rms > 3.0 && rms < 20.0;  // three more times the grain of about 1.5 grey values
  });
}

TEST_CASE("a drive without a camera has no film") {
  const SimulatedDrive drive = simulate(small("highway", 2.0, 1.0, CameraLayout::kNone), 1);
  CHECK(drive.exposures.empty());
  InlineExecutor executor;
  CHECK_THROWS_AS(Film(drive, executor), std::invalid_argument);
}

}  // namespace
}  // namespace roadfix
