// Errors of fixes that wander: as states beside the filter, as what fixes show of them, and in whole drives.
#include <catch2/catch.hpp>

#include "filter_run.h"
#include "gnss_ins/measurement.h"
#include "random_state.h"
#include "simulation/random.h"

using namespace roadfix;

namespace {

constexpr int kAll = kStates + FixError::kSize;
using AllMatrix = Eigen::Matrix<double, kAll, kAll>;
using AllVector = Eigen::Matrix<double, kAll, 1>;

/// Filter and fix error as one covariance.
AllMatrix joined(const ErrorMatrix& P, const FixError& e) {
  AllMatrix out;
  out << P, e.cross, e.cross.transpose(), e.cov;
  return out;
}

ErrorMatrix some_covariance(test::RandomState& random) {
  ErrorMatrix L;
  for (int i = 0; i < kStates; ++i)
    for (int k = 0; k < kStates; ++k) L(i, k) = 0.1 * random.number(1.0);
  return L * L.transpose();
}

Measurement<3> some_position(const NavState& x, test::RandomState& random) {
  BodyMotion motion;
  motion.rate = random.vector(0.3);
  Measurement<3> m = gnss_position(x, motion, x.position + random.vector(2.0), Eigen::Matrix3d::Identity(), 0.01);
  m.displaced = 0;
  return m;
}

const Eigen::Vector3d kVariance(0.5, 0.6, 2.0);
constexpr LastingShare kHalf{0.5, 1.0 / 15.0};

}  // namespace

TEST_CASE("a fix error moves and is updated as the states of a larger filter") {
  test::RandomState random(5);
  const GnssInsConfig config;
  TransitionSums sums;
  InertialStep step;
  step.dt = 0.05;
  step.specific_force = {0.3, -1.0, 9.7};
  step.rate = {0.05, 0.0, 0.3};
  sums.add(padded_rotation(Eigen::Quaterniond::Identity()), step.dt * step.specific_force, step, 1e-4, 1e-3);
  const Transition phi(sums, Eigen::Vector3d(0.0, 5e-5, 5e-5), config);
  for (int trial = 0; trial < 5; ++trial) {
    NavState x = random.state(0.1);
    ErrorMatrix P = some_covariance(random);
    FixError e;
    e.begin_return({3.0, 4.0, 6.0});
    e.expect_lasting(FixType::kSingle, kHalf, kVariance, x, P);
    for (int k = 0; k < 3; ++k) {  // so that everything is correlated with everything
      const Measurement<3> m = some_position(x, random);
      Innovation<3>(P, e, m).apply(x, P, e, {});
    }
    const AllMatrix before = joined(P, e);
    const FixError::Vector value = e.value;

    ErrorMatrix moved;
    propagate_covariance(P, phi, sums, moved);
    e.move(phi, sums.duration);
    AllMatrix Phi = AllMatrix::Identity();
    Phi.topLeftCorner<kStates, kStates>() = phi.dense();
    const auto of_error = [&](const FixError::Vector& v) {  // (M.38), (M.47)
      FixError::Vector out = v;
      out.head<3>() *= std::exp(-sums.duration * std::exp(v(FixError::kRate)));
      out.segment<3>(FixError::kLasting) *= std::exp(-sums.duration * kHalf.rate);
      return out;
    };
    for (int k = 0; k < FixError::kSize; ++k) {
      FixError::Vector up = value, down = value;
      up(k) += 1e-5;
      down(k) -= 1e-5;
      Phi.block<FixError::kSize, 1>(kStates, kStates + k) = (of_error(up) - of_error(down)) / 2e-5;
    }
    CHECK(e.value.isApprox(of_error(value), 1e-12));
    AllMatrix expected = Phi * before * Phi.transpose();
    expected.topLeftCorner<kStates, kStates>() = moved;  // what the filter's own tests check
    expected(kStates + FixError::kRate, kStates + FixError::kRate) += 0.3 * 0.3 * sums.duration;
    const AllMatrix without_noise = expected;
    const double driven = 1.0 - std::exp(-2.0 * sums.duration * kHalf.rate);
    expected.diagonal().tail<3>() += driven * kHalf.share * kVariance;
    CHECK(joined(moved, e).isApprox(expected, 1e-8));
    CHECK_FALSE(joined(moved, e).isApprox(without_noise, 1e-8));  // teeth

    const Measurement<3> m = some_position(x, random);
    Eigen::Matrix<double, 3, kAll> H;
    H << m.H, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity();
    const auto update = [&](const Eigen::Matrix<double, 3, kAll>& by) {
      const Eigen::Matrix3d S = by * expected * by.transpose() + m.R;
      const Eigen::Matrix<double, kAll, 3> K = expected * by.transpose() * S.inverse();
      return std::pair(AllVector(K * m.residual), AllMatrix(expected - K * S * K.transpose()));
    };
    const auto [dx, after] = update(H);
    const NavState x_before = x;
    const FixError::Vector value_before = e.value;
    Innovation<3>(moved, e, m).apply(x, moved, e, {});
    CHECK(joined(moved, e).isApprox(after, 1e-6));
    CHECK((e.value - value_before).isApprox(dx.tail<FixError::kSize>(), 1e-6));
    CHECK(local(x_before, x).isApprox(dx.head<kStates>(), 1e-6));
    // Teeth: a fix that knows of no lasting error.
    H.rightCols<3>().setZero();
    CHECK_FALSE(joined(moved, e).isApprox(update(H).second, 1e-3));
  }
}

namespace {

struct Shared {
  Eigen::Vector3d position, error;
  ErrorMatrix P;
};

/// Twenty fixes of a receiver that stands, believed in with `first`, then with `second`; its error does not fade.
Shared shared_out(double first, double second) {
  test::RandomState random(9);
  NavState x;
  ErrorMatrix P = 1e6 * ErrorMatrix::Identity();
  FixError e;
  constexpr double kNever = 1e-12;
  e.expect_lasting(FixType::kSingle, {first, kNever}, kVariance, x, P);
  for (int k = 0; k < 20; ++k) {
    Measurement<3> m;
    m.residual = Eigen::Vector3d(0.7, -1.0, 2.0) + random.vector(0.3) - x.position - e.after(0.0);
    m.H.leftCols<3>().setIdentity();
    m.R = 0.1 * Eigen::Matrix3d::Identity();
    m.displaced = 0;
    Innovation<3>(P, e, m).apply(x, P, e, {});
  }
  e.expect_lasting(FixType::kSingle, {second, kNever}, kVariance, x, P);
  return {x.position, e.after(0.0), P};
}

}  // namespace

TEST_CASE("where more or less of the error lasts than was believed, fixes are shared out as if that had been known") {
  for (const auto& [first, second] : {std::pair(0.01, 0.8), std::pair(0.8, 0.01), std::pair(0.3, 0.5)}) {
    CAPTURE(first, second);
    const Shared told = shared_out(second, second), turned = shared_out(first, second);
    if (second < first) {  // what is more unsure than it was believed to be stays where it is
      CHECK(turned.position.isApprox(told.position, 1e-4));
      CHECK(turned.error.isApprox(told.error, 1e-4));
    }
    CHECK(turned.P.topLeftCorner<3, 3>().isApprox(told.P.topLeftCorner<3, 3>(), 1e-4));
    CHECK_FALSE(shared_out(first, first).P.topLeftCorner<3, 3>().isApprox(told.P.topLeftCorner<3, 3>(), 0.1));  // teeth
  }
}

namespace {

/// What the watch makes of `seconds` of fixes of one metre, `share` of whose variance lasts, while the driven way
/// drifts by 1 cm per square root of a second; `shuffled`: the same errors in another order.
LastingShare learnt(double share, double time_s, double rate_hz, double seconds, uint64_t seed, bool shuffled = false) {
  RandomStream white(seed, 1), order(seed, 2), drift(seed, 3);
  GaussMarkov3 lasting(std::sqrt(share), time_s, {seed, 4});
  std::vector<Eigen::Vector2d> errors;
  for (int k = 0; k < static_cast<int>(seconds * rate_hz); ++k) {
    errors.emplace_back((std::sqrt(1.0 - share) * white.normal3() + lasting.value()).head<2>());
    lasting.advance(1.0 / rate_hz);
  }
  for (size_t k = errors.size(); shuffled && k > 1; --k)
    std::swap(errors[k - 1], errors[static_cast<size_t>(order.uniform() * static_cast<double>(k))]);
  LastingWatch watch;
  LastingEvidence evidence;
  Eigen::Vector2d way = Eigen::Vector2d::Zero(), filter = Eigen::Vector2d::Zero();
  for (size_t k = 0; k < errors.size(); ++k) {
    const Eigen::Vector2d step = 0.01 / std::sqrt(rate_hz) * drift.normal3().head<2>();
    way += step;
    const Eigen::Vector2d before = errors[k] + way - filter;
    filter += 0.3 * before;  // whatever the filter makes of it
    watch.add({1'000'000 + std::llround(1e6 * static_cast<double>(k) / rate_hz), before, errors[k] + way - filter,
               Eigen::Vector2d::Ones(), Eigen::Vector2d::Constant(1e-4)},
              evidence);
  }
  return evidence.mean();
}

}  // namespace

TEST_CASE("fixes show how much of their error lasts, and for how long") {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    CAPTURE(seed);
    CHECK(learnt(0.0, 10.0, 5.0, 60.0, seed).share < 0.05);
    CHECK(learnt(0.0, 10.0, 1.0, 180.0, seed).share < 0.1);
    const LastingShare street = learnt(0.8, 15.0, 5.0, 180.0, seed), fast = learnt(0.8, 5.0, 5.0, 180.0, seed);
    CHECK(street.share > 0.6);
    CHECK(fast.share > 0.6);
    CHECK(1.0 / street.rate > 4.0);
    CHECK(1.0 / fast.rate < 15.0);
    CHECK(learnt(0.64, 30.0, 1.0, 180.0, seed).share > 0.3);
    // Teeth: the same errors in another order are white.
    CHECK(learnt(0.8, 15.0, 5.0, 180.0, seed, true).share < 0.05);
  }
}

namespace {

struct Drives {
  double ratio = 0.0, rms = 0.0, honest = 0.0;  ///< squares over variances; m; share within three sigmas
};

/// City loops with `white` and `wandering` errors (m), from the first minute on.
Drives drives(FixType type, double rate_hz, double white, double wandering, double time_s, bool expects) {
  test::LevelScore score;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 200.0;
    s.gnss.fix_type = type;
    s.gnss.rate_hz = rate_hz;
    s.gnss.sigma_horizontal_m = white;
    s.gnss.sigma_up_m = 2.0 * white;
    s.gnss.multipath_sigma_m = wandering;
    s.gnss.multipath_correlation_s = time_s;
    GnssInsConfig config = test::filter_config(s);
    config.aiding.use_lasting_error = expects;
    GnssIns filter(config);
    score.run(filter, simulate(s, seed), 60.0, 199.0);
  }
  return {score.squares / score.variances, std::sqrt(score.squares / score.scored), score.share()};
}

}  // namespace

TEST_CASE("errors of two kinds at once do not make a wrong place sure, and white ones cost next to nothing") {
  struct Case {
    FixType type;
    double rate_hz, white, wandering, time_s;
  };
  for (const Case& c :
       {Case{FixType::kDifferential, 5.0, 0.3, 0.6, 15.0}, Case{FixType::kSingle, 1.0, 1.5, 2.0, 30.0}}) {
    const Drives now = drives(c.type, c.rate_hz, c.white, c.wandering, c.time_s, true);
    const Drives trusting = drives(c.type, c.rate_hz, c.white, c.wandering, c.time_s, false);
    const Drives white = drives(c.type, c.rate_hz, c.white, 0.0, c.time_s, true);
    const Drives told = drives(c.type, c.rate_hz, c.white, 0.0, c.time_s, false);
    std::printf(
        "%.1f m white and %.1f m for %.0f s: squares over variances %.2f, rms %.2f m, within three sigma %.3f; "
        "trusting "
        "%.2f, %.2f m, %.3f; white alone %.2f, %.3f m, %.3f; trusting %.2f, %.3f m\n",
        c.white, c.wandering, c.time_s, now.ratio, now.rms, now.honest, trusting.ratio, trusting.rms, trusting.honest,
        white.ratio, white.rms, white.honest, told.ratio, told.rms);
    CHECK(now.ratio < 2.5);
    CHECK(now.honest > 0.9);
    CHECK(trusting.ratio > 4.0);  // teeth
    CHECK(trusting.honest < 0.8);
    CHECK(white.rms < 1.1 * told.rms);
    CHECK(white.ratio > 0.6 * told.ratio);
    CHECK(white.honest > 0.99);
  }
}

TEST_CASE("a gated fix leaves the same bits as none where errors last, of another type as well") {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 60.0;
  test::give_poor_fixes(s);
  const SimulatedDrive drive = simulate(s, 3);
  const auto after = [&](const test::Samples& samples) {
    GnssIns filter(test::filter_config(s));
    test::run(filter, samples, [](GnssIns& f, int64_t) { f.clear_records(); });
    return filter;
  };
  test::Samples without(drive);
  const GnssFix bad = without.gnss[50];
  without.gnss.erase(without.gnss.begin() + 50);
  const GnssIns plain = after(without);
  REQUIRE(plain.core()->fix_error().lasts());
  for (const FixType type : {FixType::kSingle, FixType::kDifferential})
    for (const double off : {200.0, 0.0}) {
      test::Samples samples(drive);
      samples.gnss[50] = bad;
      samples.gnss[50].fix_type = type;
      samples.gnss[50].velocity.reset();
      samples.gnss[50].antenna = EnuAnchor(bad.antenna).geodetic({off, 0.0, 0.0});
      const GnssIns other = after(samples);
      const bool same = other.core()->covariance() == plain.core()->covariance() &&
                        local(other.core()->state(), plain.core()->state()).isZero(0.0) &&
                        other.core()->fix_error().value == plain.core()->fix_error().value;
      CHECK(same == (off > 0.0));  // teeth: a fix that passes changes them
    }
}

TEST_CASE("a snapshot goes on to the same bits where errors last") {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 60.0;
  test::give_poor_fixes(s);
  const SimulatedDrive drive = simulate(s, 3);
  const test::Samples samples(drive);
  for (const double share : {0.1, 0.5}) {  // while and after it aligns
    GnssIns whole(test::filter_config(s)), resumed(test::filter_config(s));
    test::Feeder feeder(samples);
    for (auto left = static_cast<size_t>(share * static_cast<double>(samples.imu.size())); left > 0; --left)
      feeder.step(whole);
    resumed.load(whole.save());
    for (test::Feeder other = feeder; feeder.step(whole) && other.step(resumed);) continue;
    CHECK(whole.save() == resumed.save());
  }
}
