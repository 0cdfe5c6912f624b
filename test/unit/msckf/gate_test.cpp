// The gate on a track's residual: of true tracks it refuses the share that it says; false ones it keeps out.
#include <catch2/catch.hpp>

#include "statistics/consistency.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr uint64_t kDrives = 2;
constexpr int kDegrees = 9;
constexpr double kDuration = 30.0;
constexpr double kFalsePerFrame = 0.02;  // of the tracks, that follow something else from then on

struct Gated {
  int used = 0, refused = 0, running = 0;
  ConsistencyAccumulator all;  ///< position, attitude, velocity at the end
  [[nodiscard]] double share() const { return static_cast<double>(refused) / (used + refused); }
};

Gated drive(double false_per_frame, double gate) {
  Gated sum;
  test::VisualDriveConfig car = test::city_drive(kDuration);
  car.tracks.wanted = 80;
  car.tracks.moving_cars = false;
  car.tracks.mismatch_per_frame = false_per_frame;
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    const test::VisualDrive d = test::make_drive(car, seed);
    MsckfConfig config = test::filter_config(car);
    config.aiding.use_sideslip = false;
    config.window.gate = gate;
    Msckf filter(config);
    int64_t newest = 0;
    test::run(filter, d, false, [&](const Msckf& f) {
      if (f.state() == nullptr || f.state()->clones.empty() || f.state()->clones.back().id == newest) return;
      newest = f.state()->clones.back().id;
      sum.used += f.counts().used;
      sum.refused += f.counts().refused;
    });
    const MsckfOutput o = filter.output();
    if (o.phase != MsckfPhase::kRunning || o.reset_counter != 0) continue;
    ++sum.running;
    const Eigen::Matrix<double, 9, 1> e = test::error_of(o.odometry, d);
    sum.all.add(e.head<6>().dot(o.odometry.cov_pose.inverse() * e.head<6>()), 6);
    sum.all.add(e.tail<3>().dot(o.odometry.cov_velocity.inverse() * e.tail<3>()), 3);
  }
  std::printf("gate %.7f, %.0f of 100 tracks go wrong per picture: %.4f of %d refused, NEES %.3f (%d drives)\n", gate,
              100.0 * false_per_frame, sum.share(), sum.used + sum.refused, sum.all.ratio(), sum.running);
  return sum;
}

}  // namespace

TEST_CASE("the gate refuses as many true tracks as it says") {
  for (const double gate : {0.99, 0.9}) {
    const Gated g = drive(0.0, gate);
    CHECK(g.running == kDrives);
    CHECK(g.share() > 0.5 * (1.0 - gate));
    CHECK(g.share() < 1.7 * (1.0 - gate));
  }
}

TEST_CASE("false tracks are kept out, and the errors stay what the covariance says") {
  const Band band = chi_square_band(kDrives, kDegrees);
  const Gated gated = drive(kFalsePerFrame, 0.99);
  CHECK(gated.running == kDrives);
  CHECK(gated.share() > 0.05);
  CHECK(gated.all.ratio() < band.high);
}
