/// The failover's claim against its error over 50 seeds: vision and wheels carry while GNSS/INS is dead.
#include <catch2/catch.hpp>
#include <cmath>

#include "simulation/random.h"
#include "simulation/scenarios.h"
#include "statistics/consistency.h"
#include "statistics/summary.h"
#include "streams.h"

namespace roadfix {
namespace {

constexpr int kSeeds = 50;

struct Outcome {
  double nees = 0.0;           ///< per degree of freedom, 10, 20 and 30 s after the loss
  double within_3sigma = 0.0;  ///< share of horizontal errors
  double median_error = 0.0;   ///< m, at the end
  double median_sigma = 0.0;   ///< m
  double median_share = 0.0;   ///< end error over the way
};

/// What happens to the witnesses in the failover alone.
struct Loss {
  double noise = 1.0;     ///< over what the configuration says: nothing could show it
  double yaw_walk = 0.0;  ///< rad per sqrt(s): no yaw rate any more
  bool told = false;      ///< they are coasting then, and claim that walk
};

Outcome outcome(const Loss& loss, bool vision) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 90.0;
  s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
  s.mag.rate_hz = 0.0;
  const double lost = 55.0, epochs[] = {65.0, 75.0, 84.9};
  ConsistencyAccumulator nees;
  std::vector<double> errors, sigmas, shares;
  int within = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SimulatedDrive drive = simulate(s, seed);
    const auto t_of = [&](const test::StreamEvent& e) {
      return seconds_between(s.start_utime, e.sample.odometry.t_us);
    };
    std::vector<std::vector<test::StreamEvent>> streams{ins_stream(drive, test::InsNoise{}, seed)};
    test::VoNoise vo, wheels;
    wheels.rate_hz = 20.0;
    // What step by step is 0.01 m and 2e-4 rad per sqrt(s), as the configuration has it.
    vo.step_sigma = 0.01 * std::sqrt(0.1);
    vo.yaw_step = 1e-4 * std::sqrt(0.1);
    wheels.step_sigma = 0.01 * std::sqrt(0.05);
    wheels.yaw_step = 2e-4 * std::sqrt(0.05);
    vo.step_share = wheels.step_share = 0.0;
    if (loss.noise != 1.0 || loss.yaw_walk > 0.0) {
      RandomStream random(seed, 7);
      for (test::VoNoise* n : {&vo, &wheels}) {
        const double more = loss.noise == 1.0 ? 0.0 : loss.noise, walk = loss.yaw_walk / std::sqrt(n->rate_hz);
        n->fault = [&random, more, walk, lost, sigma = n->step_sigma, yaw = n->yaw_step](double t_s, Planar& motion) {
          if (t_s > lost) {
            motion += more * Planar(sigma * random.normal(), sigma * random.normal(), yaw * random.normal());
            if (walk > 0.0) motion.z() += walk * random.normal();
          }
          return true;
        };
      }
      if (vision) streams.push_back(vo_stream(drive, vo, seed));
      streams.push_back(wheel_stream(drive, wheels, seed));
    } else {
      if (vision) streams.push_back(vo_stream(drive, vo, seed));
      streams.push_back(wheel_stream(drive, wheels, seed));
    }
    auto events = test::merged(streams);
    for (test::StreamEvent& e : events) {
      if (!loss.told || e.sample.channel == FusionChannel::kIns || t_of(e) <= lost) continue;
      e.sample.odometry.validity = Validity::kCoasting;
      e.sample.odometry.cov_pose(5, 5) += loss.yaw_walk * loss.yaw_walk * (t_of(e) - lost);
    }
    std::erase_if(
        events, [&](const test::StreamEvent& e) { return e.sample.channel == FusionChannel::kIns && t_of(e) > lost; });
    Fusion fusion({});
    std::size_t epoch = 0;
    double way = 0.0;
    std::optional<Eigen::Vector3d> last;
    test::run(fusion, events, [&](const FusedPoses& f, const test::StreamEvent& e) {
      const double t = t_of(e);
      if (t < lost + 0.5 || epoch == std::size(epochs)) return;
      const Eigen::Vector3d place = drive.truth_at(f.fused.t_us).T_frame_vehicle.p;
      if (last) way += (place - *last).norm();
      last = place;
      const test::PlanarError p = test::planar_error(drive, f.fused);
      const double sigma = std::sqrt(p.cov.topLeftCorner<2, 2>().trace());
      ++all;
      within += p.distance() < 3.0 * sigma ? 1 : 0;
      if (t < epochs[epoch]) return;
      nees.add(p.nees(), 3);
      if (++epoch < std::size(epochs)) return;
      errors.push_back(p.distance());
      sigmas.push_back(sigma);
      shares.push_back(p.distance() / way);
    });
  }
  const Outcome o{nees.ratio(), static_cast<double>(within) / all, median(errors), median(sigmas), median(shares)};
  WARN("NEES " << o.nees << ", within 3 sigma " << o.within_3sigma << "; after 30 s: median error " << o.median_error
               << " m beside sigma " << o.median_sigma << " m, " << 100.0 * o.median_share << " % of the way");
  return o;
}

TEST_CASE("the failover's covariance is honest: vision and wheels") {
  const Outcome o = outcome({}, true);
  CHECK(o.nees > 0.7);
  CHECK(o.nees < 1.3);
  CHECK(o.within_3sigma > 0.99);
  CHECK(o.median_share < 0.005);
}

TEST_CASE("the failover's covariance is honest: wheels alone") {
  const Outcome o = outcome({}, false);
  CHECK(o.nees > 0.7);
  CHECK(o.nees < 1.3);
  CHECK(o.within_3sigma > 0.99);
}

TEST_CASE("teeth: witnesses whose noise grows threefold when nobody can show it are found out") {
  CHECK(outcome({.noise = 3.0}, false).nees > 1.3);
}

TEST_CASE("wheels that lose their yaw rate and say so: the failover claims what they claim") {
  const Outcome o = outcome({.yaw_walk = 0.01, .told = true}, false);
  CHECK(o.nees > 0.7);
  CHECK(o.nees < 1.3);
  CHECK(o.within_3sigma > 0.99);
}

TEST_CASE("teeth: wheels that lose their yaw rate and do not say so are found out") {
  CHECK(outcome({.yaw_walk = 0.01}, false).nees > 3.0);
}

}  // namespace
}  // namespace roadfix
