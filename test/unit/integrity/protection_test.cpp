#include "integrity/protection.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "small_witnessed_car.h"
#include "stream/state_bytes.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

constexpr int kSeeds = 20;

/// Share of misleading samples over the seeds, after the first 20 s.
double misleading(CarOptions options, const IntegrityConfig& config, Risk risk) {
  int64_t above = 0, all = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    options.seed = static_cast<uint64_t>(seed);
    for (const CarSample& s : drive(options, config)) {
      if (s.t < 20.0) continue;
      ++all;
      above += s.misleading(risk) ? 1 : 0;
    }
  }
  return static_cast<double>(above) / static_cast<double>(all);
}

/// Tails taken for Gaussian of what is claimed, and nothing learnt of either.
IntegrityConfig gaussian() {
  IntegrityConfig config;
  config.tails = {.prior_dof = 1000.0, .memory = 1.0, .correlation = 1000.0};
  config.correlated_share = 0.0;
  config.lever_arm_std.setZero();
  return config;
}

/// Believes that nothing but the covariance may be wrong: no dead reckoning, the receiver's own drift for none.
CarOptions without_witness(CarOptions options, IntegrityConfig& config) {
  options.witness = false;
  config.witness.unwitnessed_std.setConstant(1e-3);
  return options;
}

/// Drawn away at 0.3 m/s from 100 s on, the claim as before.
CarOptions dragged() {
  CarOptions options;
  options.seconds = 140.0;
  options.fault = [](double t) -> Eigen::Vector3d {
    return Eigen::Vector3d(0.2, -0.22, 0.0) * std::max(0.0, t - 100.0);
  };
  return options;
}

/// Silent from 60 to 90 s; what comes back is 3 m off for 15 s.
CarOptions displaced_return() {
  CarOptions options;
  options.fixes = [](double t) { return t < 60.0 || t > 90.0; };
  options.fault = [](double t) { return Eigen::Vector3d(t > 90.0 && t < 105.0 ? 3.0 : 0.0, 0.0, 0.0); };
  return options;
}

/// Silent from 80 s on; meanwhile pulled aside as a camera does that is turned by 1 degree, 15 m/s, none of it claimed.
CarOptions turned_camera() {
  CarOptions options;
  options.seconds = 130.0;
  options.follows = true;
  options.fixes = [](double t) { return t < 80.0; };
  options.fault = [](double t) -> Eigen::Vector3d {
    return 15.0 * std::sin(1.0 / 57.3) * Eigen::Vector3d(-std::sin(1.8), std::cos(1.8), 0.0) * std::max(0.0, t - 82.0);
  };
  return options;
}

void check_never_smaller(const std::vector<CarSample>& less, const std::vector<CarSample>& more, double from = 0.0) {
  REQUIRE(less.size() == more.size());
  int smaller = 0;
  for (std::size_t i = 0; i < less.size(); ++i) {
    for (std::size_t r = 0; r < kRisks && less[i].t >= from; ++r)
      smaller += (less[i].protection.level[r].array() < more[i].protection.level[r].array()).any() ? 1 : 0;
  }
  CHECK(smaller == 0);
}

}  // namespace

TEST_CASE("protection: errors as claimed are below their levels, and the levels are good for a freeway") {
  CHECK(misleading({}, {}, kFrequent) <= 1e-3);
  CHECK(misleading({}, {}, kRare) == 0.0);
  const std::vector<CarSample> samples = drive({}, {});
  const auto usable = std::ranges::count_if(samples, [](const CarSample& s) { return s.protection.usable; });
  CHECK(static_cast<double>(usable) > 0.95 * static_cast<double>(samples.size()) - 20);
  CHECK(samples.back().protection.level[kFrequent].y() < 0.2);
}

TEST_CASE("protection: errors of twice the claim, which innovations show, are still below, Gaussian tails are not") {
  CarOptions options;
  options.claim = 0.5;
  options.innovation = 2.0;
  CHECK(misleading(options, {}, kFrequent) <= 1e-3);
  IntegrityConfig config = gaussian();
  CHECK(misleading(without_witness(options, config), config, kFrequent) > 3e-3);
}

TEST_CASE("protection: drawn away by its receiver, the level holds the error, or without a witness misleads") {
  CHECK(misleading(dragged(), {}, kRare) == 0.0);
  IntegrityConfig config;
  CHECK(misleading(without_witness(dragged(), config), config, kRare) > 0.1);
}

TEST_CASE("protection: drawn away, it says within 10 s that the pose is of no use, and why") {
  for (const CarSample& s : drive(dragged(), {})) {
    if (s.t < 110.0) continue;
    CHECK_FALSE(s.protection.usable);
    CHECK(s.protection.hypothesis == Hypothesis::kContradiction);
    CHECK(s.protection.reason.find("contradict dead reckoning") != std::string::npos);
  }
}

TEST_CASE("protection: displaced after an outage, the level holds until that is verified, trusted at once, not") {
  CHECK(misleading(displaced_return(), {}, kFrequent) <= 1e-3);
  IntegrityConfig hasty;
  hasty.coasting_after = 60.0;  // for no outage at all
  CHECK(misleading(without_witness(displaced_return(), hasty), hasty, kFrequent) > 1e-3);
}

TEST_CASE(
    "protection: an antenna 0.3 m ahead of where it is said to be is within the levels, without an allowance not") {
  CarOptions options;
  options.fault = [](double t) -> Eigen::Vector3d {
    const double yaw = 0.3 + 0.1 * std::clamp(t - 60.0, 0.0, 15.0);
    return 0.3 * Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0);
  };
  CHECK(misleading(options, {}, kFrequent) <= 1e-3);
  CHECK(misleading(options, {}, kRare) == 0.0);
  IntegrityConfig exact;
  exact.lever_arm_std.setZero();
  CHECK(misleading(options, exact, kFrequent) > 0.1);
}

TEST_CASE("protection: pulled aside by a turned camera in an outage, the level holds the error, without wheels not") {
  CHECK(misleading(turned_camera(), {}, kRare) == 0.0);
  IntegrityConfig config;
  CHECK(misleading(without_witness(turned_camera(), config), config, kRare) > 0.1);
}

TEST_CASE("protection: less information is never a smaller level") {
  CarOptions even;
  even.even = true;
  const std::vector<CarSample> all = drive(even, {});
  CarOptions wider = even, seldom = even, alone = even, later_alone = even, outage = even;
  wider.claim = 2.0;
  seldom.every_fix_s = 3.4;
  alone.witness = false;
  later_alone.witness_until = 80.0;
  outage.fixes = [](double t) { return t < 100.0; };
  check_never_smaller(drive(wider, {}), all);
  check_never_smaller(drive(alone, {}), all);
  check_never_smaller(drive(later_alone, {}), all, 80.3);  // the last pose of a witness holds for 0.2 s
  const std::vector<CarSample> few = drive(seldom, {}), silent = drive(outage, {});
  check_never_smaller(few, all);
  check_never_smaller(silent, all);
  CHECK(few.back().protection.level[kRare].x() > all.back().protection.level[kRare].x());
  for (std::size_t i = 1100; i < silent.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      CHECK(silent[i].protection.level[kRare](a) >= silent[i - 1].protection.level[kRare](a) * (1.0 - 1e-12));
    }
  }
  for (const CarSample& s : all)
    CHECK((s.protection.level[kRare].array() >= s.protection.level[kFrequent].array()).all());
}

TEST_CASE("protection: what has no position yet, or no valid pose, has no bound and says so") {
  CarOptions never;
  never.seconds = 5.0;
  never.fixes = [](double) { return false; };
  for (const CarSample& s : drive(never, {})) {
    CHECK_FALSE(s.protection.level[kFrequent].allFinite());
    CHECK_FALSE(s.protection.usable);
    CHECK_FALSE(s.protection.reason.empty());
  }
  ProtectionMonitor monitor({});
  Odometry invalid = pose(1, Eigen::Vector3d::Zero(), 0.0, 0.0, 0.1);
  invalid.validity = Validity::kInvalid;
  CHECK(monitor.bound(invalid).reason == "the pose is not valid");
}

TEST_CASE("protection: what is fed by a contradicted estimate is held against its own pose of that time") {
  CarOptions options = dragged();
  const auto tell = [](double t, ProtectionMonitor& monitor) {
    if (std::abs(t - 60.0) < 0.01) monitor.inherit_contradiction(50'000'000);
  };
  const std::vector<CarSample> alone = drive(options, {}), told = drive(options, {}, tell);
  CHECK(alone[650].protection.hypothesis != Hypothesis::kContradiction);
  CHECK(told[650].protection.hypothesis == Hypothesis::kContradiction);
  CHECK(told[650].protection.level[kRare].x() > alone[650].protection.level[kRare].x());
}

TEST_CASE("protection: in a bend the level across allows for stamps that are off") {
  IntegrityConfig exact;
  exact.timing_std = 0.0;
  const std::vector<CarSample> off = drive({}, {}), on_time = drive({}, exact);
  CHECK(off[700].protection.level[kFrequent].y() > on_time[700].protection.level[kFrequent].y() + 0.01);
  CHECK(off[550].protection.level[kFrequent].y() == on_time[550].protection.level[kFrequent].y());
}

TEST_CASE("protection: a snapshot goes on to the same bits") {
  const std::vector<CarSample> whole = drive(dragged(), {});
  const auto exchange = [](double t, ProtectionMonitor& monitor) {
    if (std::abs(t - 105.0) > 0.01) return;
    StateArchiveOut out;
    ProtectionMonitor::archive(std::as_const(monitor), out);
    const std::vector<uint8_t> bytes = out.out.take();
    monitor = ProtectionMonitor({});
    StateArchiveIn in{StateReader(bytes)};
    ProtectionMonitor::archive(monitor, in);
    in.in.finish();
  };
  const std::vector<CarSample> resumed = drive(dragged(), {}, exchange);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    REQUIRE(resumed[i].protection.level == whole[i].protection.level);
    REQUIRE(resumed[i].protection.since_check == whole[i].protection.since_check);
  }
}
