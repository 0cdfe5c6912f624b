/// Honest covariance of the fusion over 20 seeds, and the literal scheme's that is not.
#include <catch2/catch.hpp>
#include <cmath>

#include "simulation/scenarios.h"
#include "statistics/consistency.h"
#include "statistics/summary.h"
#include "streams.h"

namespace roadfix {
namespace {

constexpr int kSeeds = 20;

struct Outcome {
  double nees = 0.0;              ///< per degree of freedom, over seeds and epochs that are far apart
  double within_3sigma = 0.0;     ///< share of horizontal errors
  double median_error = 0.0;      ///< m, at the end of the outage
  double median_sigma = 0.0;      ///< m
  double median_way_share = 0.0;  ///< end error over the way in the outage
};

Outcome outcome(const FusionConfig& config, double noise = 1.0, bool vision = true) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 120.0;
  s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
  s.mag.rate_hz = 0.0;
  const double epochs[] = {35.0, 60.0, 80.0, 99.9, 104.5, 118.5};
  ConsistencyAccumulator nees;
  std::vector<double> errors, sigmas, shares;
  int within = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SimulatedDrive drive = simulate(s, seed);
    test::InsNoise ins;
    ins.outages = {{40.0, 100.0}};
    test::VoNoise vo;
    // Real noise is `noise` times what is claimed: claimed covariances shrink against it.
    ins.claimed = 1.0 / noise;
    std::vector<std::vector<test::StreamEvent>> streams{ins_stream(drive, ins, seed)};
    if (vision) streams.push_back(vo_stream(drive, vo, seed));
    Fusion fusion(config);
    std::size_t epoch = 0;
    run(fusion, test::merged(streams), [&](const Fusion& f, const test::StreamEvent& e) {
      if (e.sample.channel != FusionChannel::kIns) return;
      const double t = seconds_between(s.start_utime, f.t_us());
      if (t < 2.0) return;
      const bool due = epoch < std::size(epochs) && t >= epochs[epoch];
      if (all++ % 10 != 0 && !due) return;
      const test::PlanarError p = test::planar_error(drive, f.fused());
      if (p.distance() < 3.0 * std::sqrt(p.cov.topLeftCorner<2, 2>().trace())) within += 10;
      if (!due) return;
      nees.add(p.nees(), 3);
      if (epochs[epoch] == 99.9) {
        errors.push_back(p.distance());
        sigmas.push_back(std::sqrt(p.cov.topLeftCorner<2, 2>().trace()));
      }
      ++epoch;
    });
  }
  Outcome o{nees.ratio(), std::min(1.0, static_cast<double>(within) / all), median(errors), median(sigmas), 0.0};
  WARN("NEES " << o.nees << ", within 3 sigma " << o.within_3sigma << "; end of outage: median error " << o.median_error
               << " m beside sigma " << o.median_sigma << " m");
  return o;
}

TEST_CASE("relative motion and gained information keep the covariance honest through an outage") {
  const Outcome o = outcome({});
  CHECK(o.nees > 0.8);
  CHECK(o.nees < 1.3);
  CHECK(o.within_3sigma > 0.99);
}

TEST_CASE("the same without vision") {
  const Outcome o = outcome({}, 1.0, false);
  CHECK(o.nees > 0.7);
  CHECK(o.nees < 1.3);
}

TEST_CASE("the literal scheme of independent absolute poses is overconfident") {
  FusionConfig literal;
  literal.scheme = FusionScheme::kLiteral;
  CHECK(outcome(literal).nees > 3.0);
}

/// NEES of the local pose's motion since the fifth second, in the plane, with fixes all the way.
double local_nees(double noise) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 60.0;
  s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
  s.mag.rate_hz = 0.0;
  const double epochs[] = {5.0, 10.0, 15.0, 30.0, 59.0};
  ConsistencyAccumulator nees;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SimulatedDrive drive = simulate(s, seed);
    test::InsNoise ins;
    ins.claimed = 1.0 / noise;
    Fusion fusion(FusionConfig{});
    std::size_t epoch = 0;
    Planar start = Planar::Zero(), truth_start = Planar::Zero();
    run(fusion, ins_stream(drive, ins, seed), [&](const Fusion& f, const test::StreamEvent&) {
      if (epoch == std::size(epochs) || seconds_between(s.start_utime, f.t_us()) < epochs[epoch]) return;
      const Odometry local = f.local();
      const Planar pose = planar_pose(local);
      const Planar truth = pose + test::planar_error(drive, local).error;
      if (epoch++ == 0) {
        start = pose;
        truth_start = truth;
        return;
      }
      const Planar driven = motion_between(start, pose), way = motion_between(truth_start, truth);
      const Planar error = difference_of(way, driven);
      const Eigen::Matrix3d P = turned(planar_covariance(local), std::cos(start.z()), -std::sin(start.z()));
      nees.add(error.dot(P.ldlt().solve(error)), 3);
    });
  }
  WARN("NEES of the local pose " << nees.ratio());
  return nees.ratio();
}

TEST_CASE("the local pose's covariance holds what the velocity's error adds up to") {
  const double nees = local_nees(1.0);
  CHECK(nees < 1.3);
  CHECK(nees > 0.3);
  CHECK(local_nees(2.0) > 1.3);  // teeth: an INS that claims half its sigma
}

TEST_CASE("teeth: an INS that claims half its sigma is seen") { CHECK(outcome({}, 2.0).nees > 1.3); }

}  // namespace
}  // namespace roadfix
