// Lies and failures that a filter must survive, by the simulator's faults.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"

using namespace roadfix;

namespace {

struct Worst {
  double horizontal = 0.0;  ///< m, over all outputs that do not call themselves invalid, after 30 s
  double beyond = 0.0;      ///< the largest error in its own sigmas, of outputs that call themselves valid
  double last = 1e9;        ///< m, at the end
  int resets = 0;
  bool valid_at_end = false;
};

Worst drive_with(const char* fault, double duration_s, uint64_t seed, const char* second = nullptr,
                 bool scale_steps = true) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = duration_s;
  for (const char* f : {fault, second})
    if (f != nullptr) s.faults.push_back(parse_fault(f));
  const SimulatedDrive drive = simulate(s, seed);
  GnssInsConfig config = test::filter_config(s);
  config.aiding.use_scale_steps = scale_steps;
  GnssIns filter(config);
  Worst worst;
  const int64_t start = drive.imu.front().t_us;
  int64_t next = start + 30'000'000;
  test::run(filter, test::Samples(drive), [&](GnssIns& f, int64_t now) {
    f.clear_records();
    if (now < next) return;
    next += 100'000;
    const GnssInsOutput o = f.output();
    worst.resets = o.reset_counter;
    worst.valid_at_end = o.odometry.validity == Validity::kValid;
    if (o.odometry.validity == Validity::kInvalid) return;
    const double e = test::error_of(f, o.odometry, drive).head<2>().norm();
    const double sigma = std::sqrt(o.odometry.cov_pose(0, 0) + o.odometry.cov_pose(1, 1));
    worst.last = e;
    worst.horizontal = std::max(worst.horizontal, e);
    if (o.odometry.validity == Validity::kValid) worst.beyond = std::max(worst.beyond, e / sigma);
  });
  return worst;
}

/// The filter was never further off than `most`, no more than `last` (m) at the end, and never gave itself up.
void check_held(const Worst& w, double most, double last) {
  CAPTURE(w.horizontal, w.beyond, w.last, w.resets);
  CHECK(w.horizontal < most);
  CHECK(w.last < last);
  CHECK(w.resets == 0);
}

}  // namespace

TEST_CASE("fixes 15 m off for half a minute are not followed") {
  check_held(drive_with("gnss.bias@60+30:east_m=15", 120.0, 2), 1.5, 0.2);
}

TEST_CASE("a receiver that stays 15 m off is believed in the end") {
  const Worst w = drive_with("gnss.bias@60+200:east_m=15", 180.0, 2);
  CHECK(w.resets >= 1);
  CHECK(w.last > 10.0);
}

TEST_CASE("a gyro that clips in turns does not leave a lost filter that calls itself valid") {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Worst w = drive_with("imu.saturation@40+40:gyro_radps=0.2,accel_mps2=12", 150.0, seed);
    CAPTURE(seed, w.horizontal, w.beyond, w.last);
    CHECK(w.valid_at_end);
    CHECK(w.last < 0.3);
    CHECK(w.horizontal < 30.0);
  }
}

TEST_CASE("a receiver that is dragged off at half a metre a second is held against") {
  check_held(drive_with("gnss.ramp@80+40:east_mps=0.5", 150.0, 2), 1.5, 0.2);
  // What cannot be told: a drag that lasts is believed in the end, with a reset that says so.
  const Worst followed = drive_with("gnss.ramp@80+100:east_mps=0.5", 180.0, 2);
  CHECK(followed.resets >= 1);
  CHECK(followed.horizontal > 10.0);
}

namespace {

constexpr const char* kShock =
    "imu.bias@60+200:gyro_x_radps=0.002,gyro_y_radps=0.002,gyro_z_radps=0.002,"
    "accel_x_mps2=0.1,accel_y_mps2=0.1,accel_z_mps2=0.1";

}  // namespace

TEST_CASE("an IMU whose biases step is doubted, and not the fixes that show it") {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    CAPTURE(seed);
    check_held(drive_with(kShock, 120.0, seed), 0.5, 0.05);
    check_held(drive_with(kShock, 120.0, seed, "wheels.silence@0+200"), 0.5, 0.05);
  }
  // Teeth, and what cannot be told: a receiver without a velocity may be dragged off, and is refused for long.
  const Worst untold = drive_with(kShock, 120.0, 1, "gnss.no_velocity@0+200");
  CHECK(untold.horizontal > 5.0);
  CHECK(untold.resets >= 1);
}

TEST_CASE("wheels that slip by less than their gate do not lead away from fixed fixes") {
  for (const double ratio : {0.005, 0.01, 0.02, 0.03}) {
    char fault[64];
    (void)std::snprintf(fault, sizeof fault, "wheels.slip@40+50:ratio=%g", ratio);
    const Worst w = drive_with(fault, 120.0, 1);
    CAPTURE(ratio);
    check_held(w, 0.1, 0.05);
  }
  // Positions alone tell it as well. Teeth: not where the scale is believed.
  check_held(drive_with("wheels.slip@40+50:ratio=0.02", 120.0, 1, "gnss.no_velocity@0+120"), 0.1, 0.05);
  CHECK(drive_with("wheels.slip@40+50:ratio=0.02", 120.0, 1, "gnss.no_velocity@0+120", false).horizontal > 1.0);
}

TEST_CASE("a receiver that repeats itself does not make wheels doubted") {
  check_held(drive_with("gnss.stuck@60+20", 120.0, 1), 1.0, 0.05);
}

TEST_CASE("a receiver that claims 3 mm and scatters by centimetres is not locked out") {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Worst w = drive_with("gnss.claim@30+120:factor=0.1", 150.0, seed);
    CAPTURE(seed, w.horizontal, w.last);
    CHECK(w.horizontal < 0.3);
    CHECK(w.valid_at_end);
    CHECK(w.resets == 0);
  }
}

namespace {

/// Share of the level errors within three of their sigmas, in and after half a minute of multipath.
double honest_share(bool learns_correlation) {
  test::LevelScore score;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 110.0;
    s.faults.push_back(parse_fault("gnss.multipath@60+30:sigma_m=4,correlation_s=6,claim=0.5"));
    const SimulatedDrive drive = simulate(s, seed);
    GnssInsConfig config = test::filter_config(s);
    config.aiding.use_error_correlation = learns_correlation;
    config.aiding.use_lasting_error = learns_correlation;
    GnssIns filter(config);
    score.run(filter, drive, 60.0, s.duration_s);
  }
  return score.share();
}

}  // namespace

TEST_CASE("errors that stay alike under a bridge are not averaged away") {
  const double share = honest_share(true), naive = honest_share(false);
  CAPTURE(share, naive);
  std::printf("within three sigma in multipath: %.3f, taken for independent: %.3f\n", share, naive);
  // 0.998 and 0.961 were seen: fifteen times the misses where errors are taken for independent.
  CHECK(share > 0.99);
  CHECK(naive < 0.98);
}

namespace {

struct Return {
  double honest = 0.0;  ///< share of the level errors within three of their sigmas, over 20 s after the tunnel
  double error = 0.0;   ///< m, root mean square of the level errors over the same time
  double sigma = 0.0;   ///< m, likewise of what is claimed
};

/// A bridge and a minute of tunnel; the fixes after it are off by `reacquire` (nothing: as good as before) and do not
/// say so.
Return return_from_tunnel(const char* reacquire, FixType type, double sigma_m, bool expects, bool alike = true) {
  test::LevelScore score;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    ScenarioConfig s = scenario("tunnel_dark");
    s.duration_s = 172.0;
    s.gnss.fix_type = type;
    s.gnss.sigma_horizontal_m = sigma_m;
    s.gnss.sigma_up_m = 2.0 * sigma_m;
    s.faults.pop_back();  // its own return
    if (reacquire != nullptr) s.faults.push_back(parse_fault(reacquire));
    const SimulatedDrive drive = simulate(s, seed);
    GnssInsConfig config = test::filter_config(s);
    config.aiding.use_return_error = expects;
    config.aiding.use_error_correlation = alike;
    config.aiding.use_lasting_error = expects && alike;
    GnssIns filter(config);
    score.run(filter, drive, 151.0, 171.0);
  }
  return {score.share(), std::sqrt(score.squares / score.scored), std::sqrt(score.variances / score.scored)};
}

}  // namespace

TEST_CASE("fixes that come back displaced after a tunnel are not believed at their word") {
  struct Case {
    const char* fault;
    double honest;  // least share
  };
  for (const Case& c : {Case{"gnss.reacquire@150+22:error_m=4,decay_s=3", 0.99},
                        Case{"gnss.reacquire@150+22:error_m=4,decay_s=10", 0.98},
                        Case{"gnss.reacquire@150+22:error_m=15,decay_s=3", 0.99},
                        Case{"gnss.reacquire@150+22:error_m=2,decay_s=5", 0.98}}) {
    const Return expecting = return_from_tunnel(c.fault, FixType::kDifferential, 0.3, true);
    const Return trusting = return_from_tunnel(c.fault, FixType::kDifferential, 0.3, false);
    CAPTURE(c.fault, expecting.honest, expecting.error, trusting.honest, trusting.error);
    std::printf("%s: within three sigma %.3f, error %.3f m, claimed %.3f m; trusting: %.3f, %.3f m, %.3f m\n", c.fault,
                expecting.honest, expecting.error, expecting.sigma, trusting.honest, trusting.error, trusting.sigma);
    CHECK(expecting.honest > c.honest);
    CHECK(trusting.honest < 0.93);
    CHECK(expecting.error < trusting.error);
  }
}

TEST_CASE("what good fixes lose after a tunnel by expecting worse is bounded") {
  const auto compare = [](FixType type, double sigma, double most) {
    const Return expecting = return_from_tunnel(nullptr, type, sigma, true);
    const Return trusting = return_from_tunnel(nullptr, type, sigma, false);
    std::printf("good fixes of %.2f m after a tunnel: error %.4f m, claimed %.4f m; trusting: %.4f m, %.4f m\n", sigma,
                expecting.error, expecting.sigma, trusting.error, trusting.sigma);
    CHECK(expecting.honest > 0.99);
    CHECK(expecting.error < most * trusting.error);
    CHECK(expecting.sigma < most * trusting.sigma);
  };
  compare(FixType::kRtkFixed, 0.02, 1.1);
  compare(FixType::kDifferential, 0.3, 3.0);
}

TEST_CASE("fixes that are displaced for some seconds and then good do not make a wrong place sure") {
  constexpr const char* kFiveSeconds = "gnss.reacquire@150+5:error_m=2,decay_s=10000";
  const Return alike = return_from_tunnel(kFiveSeconds, FixType::kDifferential, 0.3, true);
  const Return independent = return_from_tunnel(kFiveSeconds, FixType::kDifferential, 0.3, true, false);
  std::printf(
      "two metres for five seconds: within three sigma %.3f, error %.3f m; taken for independent %.3f, %.3f m\n",
      alike.honest, alike.error, independent.honest, independent.error);
  CHECK(alike.honest > 0.97);
  CHECK(independent.honest < 0.9);
  CHECK(alike.error < independent.error);
}

namespace {

struct Holes {
  double honest = 0.0, error = 0.0;  ///< share of the level errors within three sigmas; m, the largest; over 10 s
  int resets = 0, invalid = 0;       ///< outputs that were not valid
};

/// Positions of 2 m once a second and wheels; the IMU is silent for `hole_s` at three moments of motion, a drive each.
/// What nobody saw is told by noise only where a gap is called a gap: `max_gap_s`.
Holes drive_with_holes(double hole_s, double max_gap_s) {
  Holes out;
  int inside = 0, scored = 0;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 135.0;
    test::give_poor_fixes(s);
    const SimulatedDrive drive = simulate(s, seed);
    for (const double at : {64.0, 93.0, 118.0}) {
      test::Samples samples(drive);
      for (GnssFix& fix : samples.gnss) fix.velocity.reset();
      const int64_t from = drive.imu.front().t_us + std::llround(1e6 * at), to = from + std::llround(1e6 * hole_s);
      std::erase_if(samples.imu, [&](const ImuSample& i) { return i.t_us > from && i.t_us < to; });
      GnssInsConfig config = test::filter_config(s);
      config.propagation.max_gap = max_gap_s;
      GnssIns filter(config);
      int64_t next = to;
      test::run(filter, samples, [&](GnssIns& f, int64_t now) {
        f.clear_records();
        if (now < next || now > to + 10'000'000) return;
        next += 100'000;
        const Odometry o = f.output().odometry;
        if (o.validity != Validity::kValid) {
          ++out.invalid;
          return;
        }
        const auto e = test::error_of(f, o, drive);
        for (int i = 0; i < 2; ++i) inside += e(i) * e(i) <= 9.0 * o.cov_pose(i, i);
        scored += 2;
        out.error = std::max(out.error, e.head<2>().norm());
      });
      out.resets += filter.output().reset_counter;
    }
  }
  out.honest = static_cast<double>(inside) / scored;
  return out;
}

}  // namespace

TEST_CASE("a second without IMU samples while driving costs certainty and not the pose") {
  const Holes second = drive_with_holes(1.0, 0.1), unsaid = drive_with_holes(1.0, 5.0),
              longer = drive_with_holes(3.0, 0.1);
  std::printf(
      "a hole of 1 s: within three sigma %.3f, largest error %.1f m, %d invalid, %d resets; called no gap %.3f; "
      "of 3 s: %d invalid, %d resets\n",
      second.honest, second.error, second.invalid, second.resets, unsaid.honest, longer.invalid, longer.resets);
  CHECK(second.invalid == 0);
  CHECK(second.resets == 0);
  CHECK(second.honest > 0.97);
  CHECK(unsaid.honest < 0.95);
  // After three seconds it may have turned anywhere: aligned again, which takes fixes and says so.
  CHECK(longer.resets >= 6);
  CHECK(longer.invalid > 100);
}
