// A place and a heading that somebody tells: in a garage without GNSS, before the start, while the heading is sought, and
// where it is wrong.
#include <catch2/catch.hpp>
#include <limits>
#include <random>
#include <utility>

#include "filter_run.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "statistics/consistency.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr double kPlaceStd = 2.0, kHeightStd = 1.0, kYawStd = 5.0 * kDegree;

ScenarioConfig city() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 60.0;
  return s;
}

/// Of the imu's place and the vehicle's heading `after_s` after the first sample, off by `error` (m, m, m, rad).
PriorPose told(const SimulatedDrive& drive, double after_s, const Eigen::Vector4d& error) {
  PriorPose p;
  p.t_us = drive.imu.front().t_us + static_cast<int64_t>(1e6 * after_s);
  const Odometry truth = drive.truth_at(p.t_us);
  p.place = drive.anchor.geodetic(truth.T_frame_vehicle * drive.config.imu.position_m + error.head<3>());
  p.cov_enu = Eigen::Vector3d(kPlaceStd, kPlaceStd, kHeightStd).cwiseAbs2().asDiagonal();
  p.yaw = yaw_of(truth.T_frame_vehicle.q) + error(3);
  p.yaw_std = kYawStd;
  return p;
}

struct Outcome {
  std::vector<NavigationOutput> outputs;  ///< ten times a second
  std::vector<AidingRecord> records;      ///< of prior poses
  double enu_after = 1e9, done_after = 1e9;
  Eigen::Matrix<double, 9, 1> error = Eigen::Matrix<double, 9, 1>::Zero();  ///< at the end
  std::vector<double> horizontal;                                           ///< m, error of each output in enu
};

Outcome drive_it(const SimulatedDrive& drive, const navtest::Samples& samples, const std::optional<PriorPose>& prior,
                 double to_s) {
  Navigation filter(navtest::filter_config(drive.config));
  Outcome out;
  const int64_t start = samples.imu.front().t_us;
  bool given = !prior;
  int64_t next = start;
  navtest::Feeder feeder(samples);
  // What comes before the first sample waits for it.
  if (prior && prior->t_us <= start) filter.add(*prior), given = true;
  while (feeder.step(filter) && seconds_between(start, feeder.now()) < to_s) {
    if (!given && prior->t_us <= feeder.now()) filter.add(*prior), given = true;
    for (const AidingRecord& r : filter.records())
      if (r.source == AidingSource::kPriorPose) out.records.push_back(r);
    filter.clear_records();
    const double t = seconds_between(start, feeder.now());
    if (filter.anchor() && filter.filter() != nullptr) out.enu_after = std::min(out.enu_after, t);
    if (filter.status().phase == Phase::kDone) out.done_after = std::min(out.done_after, t);
    if (feeder.now() < next) continue;
    next += 100'000;
    out.outputs.push_back(filter.output());
    if (!filter.anchor() || filter.filter() == nullptr) continue;
    out.error = navtest::error_of(filter, out.outputs.back().imu, drive);
    out.horizontal.push_back(out.error.head<2>().norm());
  }
  return out;
}

navtest::Samples without_fixes(const SimulatedDrive& drive) {
  navtest::Samples s(drive);
  s.gnss.clear();
  return s;
}

bool same_poses(const Outcome& a, const Outcome& b) {
  if (a.outputs.size() != b.outputs.size()) return false;
  for (size_t i = 0; i < a.outputs.size(); ++i) {
    const Odometry &x = a.outputs[i].odometry, &y = b.outputs[i].odometry;
    if (x.T_frame_vehicle.p != y.T_frame_vehicle.p || x.cov_pose != y.cov_pose) return false;
  }
  return true;
}

/// Of place and yaw after 25 s of driving without a fix, told with errors of `sigmas` times what is claimed.
double nees_in_garage(const ScenarioConfig& garage, double after_s, double sigmas) {
  ConsistencyAccumulator sum;
  std::mt19937 rng(3);
  std::normal_distribution<double> normal;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const SimulatedDrive drive = simulate(garage, seed);
    Eigen::Vector4d error(kPlaceStd, kPlaceStd, kHeightStd, kYawStd);
    for (int i = 0; i < 4; ++i) error(i) *= sigmas * normal(rng);
    const Outcome o = drive_it(drive, without_fixes(drive), told(drive, after_s, error), 30.0);
    REQUIRE(o.enu_after < after_s + 3.0);
    const Odometry& end = o.outputs.back().imu;
    const Eigen::Vector4d e(o.error(0), o.error(1), o.error(2), o.error(5));
    Eigen::Matrix4d P;
    const std::array<int, 4> at{0, 1, 2, 5};
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) P(i, j) = end.cov_pose(at[static_cast<size_t>(i)], at[static_cast<size_t>(j)]);
    sum.add(e.dot(P.inverse() * e), 4);
  }
  return sum.ratio();
}

}  // namespace

TEST_CASE("a pose that somebody tells puts a car without fixes where it is, and claims what was told") {
  ScenarioConfig standing = scenario("standing");
  standing.duration_s = 35.0;
  const double before = nees_in_garage(standing, 0.0, 1.0), driving = nees_in_garage(city(), 3.0, 1.0);
  std::printf("NEES of place and yaw: told before the start %.2f, to a car that drives %.2f\n", before, driving);
  for (const double nees : {before, driving}) {
    CHECK(nees > 0.6);
    CHECK(nees < 1.5);
  }
  CHECK(nees_in_garage(city(), 3.0, 2.0) > 2.0);  // teeth: told with less than it is off by
}

TEST_CASE("the jump that is counted is that of the vehicle's pose, however the imu is mounted") {
  ScenarioConfig standing = scenario("standing");
  standing.duration_s = 10.0;
  const SimulatedDrive drive = simulate(standing, 3);
  NavigationConfig config = navtest::filter_config(standing);
  config.facts.mounting = {0.2, -0.1};
  Navigation filter(config);
  PriorPose prior = told(drive, 5.0, Eigen::Vector4d::Zero());
  prior.yaw += 1.5;  // whatever the heading of the local frame
  std::optional<NavigationOutput> before, after;
  const navtest::Samples samples = without_fixes(drive);
  for (navtest::Feeder feeder(samples); !after && feeder.step(filter);) {
    filter.clear_records();
    const NavigationOutput o = filter.output();
    if (o.odometry.validity == Validity::kInvalid) continue;
    (o.local ? before : after) = o;
    if (prior.t_us != 0 && feeder.now() >= prior.t_us) filter.add(std::exchange(prior, PriorPose()));
  }
  REQUIRE(after);
  CHECK(after->reset_counter == before->reset_counter + 1);
  const Eigen::Quaterniond jumped = before->odometry.T_frame_vehicle.q * after->reset_delta.q;
  CHECK(jumped.angularDistance(after->odometry.T_frame_vehicle.q) < 1e-3);
  CHECK(after->reset_delta.q.angularDistance(Eigen::Quaterniond::Identity()) > 1.0);
  // Teeth: the jump of the imu's pose is another.
  const Eigen::Quaterniond of_imu = before->imu.T_frame_vehicle.q.conjugate() * after->imu.T_frame_vehicle.q;
  CHECK((before->odometry.T_frame_vehicle.q * of_imu).angularDistance(after->odometry.T_frame_vehicle.q) > 0.1);
}

TEST_CASE("a pose that somebody tells ends the search for a heading") {
  ScenarioConfig s = city();
  navtest::give_poor_fixes(s);
  s.gnss.sigma_velocity_mps = 0.0;
  const SimulatedDrive drive = simulate(s, 2);
  navtest::Samples samples(drive);
  const int64_t begin = drive.imu.front().t_us + 12'000'000;
  const auto drop = [&](auto& all) { std::erase_if(all, [&](const auto& x) { return x.t_us < begin; }); };
  drop(samples.imu), drop(samples.gnss), drop(samples.wheels);
  const Outcome untold = drive_it(drive, samples, std::nullopt, 40.0);
  PriorPose prior = told(drive, 15.0, Eigen::Vector4d(1.0, -1.0, 0.5, 2.0 * kDegree));
  prior.yaw_std = 2.0 * kDegree;
  const Outcome helped = drive_it(drive, samples, prior, 40.0);
  std::printf("heading known after %.1f s, told at 3 s after %.1f s\n", untold.done_after, helped.done_after);
  REQUIRE(helped.records.size() == 2);
  CHECK(helped.done_after < 4.5);
  CHECK(untold.done_after > helped.done_after + 1.0);
  CHECK(std::abs(helped.error(5)) < 2.0 * kDegree);
}

TEST_CASE("a pose that contradicts the fixes changes nothing, and says so") {
  const SimulatedDrive drive = simulate(city(), 1);
  const navtest::Samples samples(drive);
  const Outcome untold = drive_it(drive, samples, std::nullopt, 40.0);
  for (const Eigen::Vector4d& wrong : {Eigen::Vector4d(300.0, 0.0, 0.0, 0.0), Eigen::Vector4d(0.0, 0.0, 0.0, 1.0)}) {
    const Outcome lied_to = drive_it(drive, samples, told(drive, 30.0, wrong), 40.0);
    REQUIRE(lied_to.records.size() == 1);
    CHECK(lied_to.records[0].status == AidingStatus::kGated);
    CHECK(same_poses(untold, lied_to));
  }
  const Outcome right = drive_it(drive, samples, told(drive, 30.0, Eigen::Vector4d::Zero()), 40.0);
  CHECK(right.records.size() == 2);
  CHECK_FALSE(same_poses(untold, right));
}

TEST_CASE("where what was told is wrong, five fixes take the car back") {
  const SimulatedDrive drive = simulate(city(), 1);
  navtest::Samples samples(drive);
  const int64_t out_us = drive.imu.front().t_us + 15'000'000;
  std::erase_if(samples.gnss, [&](const GnssFix& f) { return f.t_us < out_us; });
  const Outcome o = drive_it(drive, samples, told(drive, 3.0, Eigen::Vector4d(300.0, -100.0, 0.0, 0.5)), 40.0);
  REQUIRE(o.horizontal.size() > 300);
  CHECK(o.horizontal[60] > 100.0);  // it was believed
  CHECK(o.horizontal.back() < 1.0);
  const double rate = drive.config.gnss.rate_hz;
  const auto within = std::find_if(o.horizontal.begin() + 120, o.horizontal.end(), [](double e) { return e < 3.0; });
  const double after_s = 0.1 * static_cast<double>(within - o.horizontal.begin()) + o.enu_after - 15.0;
  std::printf("taken back %.1f s after the first of %.0f fixes a second\n", after_s, rate);
  CHECK(after_s < 5.0 / rate + 3.0);
}

TEST_CASE("a height that nobody told is measured by the first fixes, half a kilometre higher") {
  const SimulatedDrive drive = simulate(city(), 1);
  navtest::Samples samples(drive);
  const int64_t out_us = drive.imu.front().t_us + 15'000'000;
  std::erase_if(samples.gnss, [&](const GnssFix& f) { return f.t_us < out_us; });
  const auto after = [&](double height_std) {
    PriorPose prior = told(drive, 3.0, Eigen::Vector4d(0.0, 0.0, -500.0, 0.0));
    prior.cov_enu(2, 2) = height_std * height_std;
    return drive_it(drive, samples, prior, 20.0);
  };
  const Outcome o = after(3000.0);
  CHECK(o.outputs[100].imu.cov_pose(2, 2) > 500.0 * 500.0);
  CHECK(std::abs(o.error(2)) < 1.0);
  CHECK(o.outputs.back().reason.empty());
  CHECK(o.outputs.back().reset_counter == 1);
  // Teeth: told to be known, it contradicts the fixes.
  const Outcome sure = after(5.0);
  CHECK((!sure.outputs.back().reason.empty() || sure.outputs.back().reset_counter > 1));
}

TEST_CASE("what is no pose is refused") {
  const SimulatedDrive drive = simulate(city(), 1);
  const navtest::Samples samples = without_fixes(drive);
  PriorPose nowhere = told(drive, 3.0, Eigen::Vector4d::Zero()), exact = nowhere;
  nowhere.place.latitude = std::numeric_limits<double>::quiet_NaN();
  exact.cov_enu(1, 1) = 0.0;
  for (const PriorPose& p : {nowhere, exact}) {
    const Outcome o = drive_it(drive, samples, p, 10.0);
    REQUIRE(o.records.size() == 1);
    CHECK(o.records[0].status == AidingStatus::kBadInput);
    CHECK(o.enu_after > 1e8);
  }
}

TEST_CASE("a snapshot holds what was told and waits") {
  const SimulatedDrive drive = simulate(city(), 1);
  const navtest::Samples samples = without_fixes(drive);
  Navigation first(navtest::filter_config(drive.config)), second(navtest::filter_config(drive.config));
  first.add(told(drive, 0.0, Eigen::Vector4d::Zero()));
  second.load(first.save());
  navtest::Feeder feeder(samples), again(samples);
  while (feeder.now() < drive.imu.front().t_us + 5'000'000) {
    REQUIRE(feeder.step(first));
    REQUIRE(again.step(second));
  }
  REQUIRE(first.anchor());
  CHECK(second.output().odometry.T_frame_vehicle.p == first.output().odometry.T_frame_vehicle.p);
}
