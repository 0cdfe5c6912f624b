// A lens that is not quite as calibrated, (N.6.9): what it does to lengths where it is known and where it is not.
#include <catch2/catch.hpp>

#include "simulation/random.h"
#include "statistics/consistency.h"
#include "support/visual_drive.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr int kDrives = 16;
constexpr double kFocalStd = 0.01, kRadialStd = 0.02, kRadial4Std = 0.05;

Eigen::Vector2d distorted(const Eigen::Vector3d& lens, const Eigen::Vector2d& n) {
  const double r2 = n.squaredNorm(), s = r2 / (1.0 + r2);
  return std::exp(lens.x()) * (1.0 + lens.y() * s + lens.z() * s * s) * n;
}

struct Outcome {
  ConsistencyAccumulator lens, velocity;
  int running = 0;
};

/// City streets seen through lenses drawn from their doubt, times `off`; the filter doubts them times `told`, and r^4
/// besides times `told4`.
Outcome drive_all(int drives, double off, double told, double told4 = 1.0) {
  Outcome out;
  const test::VisualDriveConfig car = test::city_drive(45.0);
  for (int seed = 1; seed <= drives; ++seed) {
    test::VisualDrive d = test::make_drive(car, static_cast<uint64_t>(seed));
    RandomStream random(static_cast<uint64_t>(seed), 0x1E45);
    Eigen::Vector3d truth(kFocalStd, kRadialStd, kRadial4Std);
    for (double& c : truth) c *= off * random.normal();
    NavigationConfig config = test::filter_config(car);
    const Camera camera(config.facts.camera->left);
    for (TrackPicture& frame : d.frames)
      for (TrackSighting& s : frame.tracks)
        s.left = camera.distort(distorted(truth, *camera.unproject(s.left))).value();
    config.facts.camera->focal_std = told * kFocalStd;
    config.facts.camera->radial_std = told * kRadialStd;
    config.facts.camera->radial4_std = told * told4 * kRadial4Std;
    Navigation filter(config);
    test::run(filter, d, false, [](Navigation&) {});
    if (filter.filter() == nullptr) continue;
    const State& s = filter.filter()->state();
    ++out.running;
    const Eigen::Vector3d e = truth - s.x.lens;
    const int learnt = told == 0.0 ? 0 : told4 == 0.0 ? 2 : 3;
    const Eigen::MatrixXd P = s.P().block(kLens, kLens, learnt, learnt);
    if (learnt > 0) out.lens.add(e.head(learnt).dot(P.inverse() * e.head(learnt)), learnt);
    const Odometry o = filter.output().imu;
    const Eigen::Vector3d dv = test::error_of(o, d).tail<3>();
    out.velocity.add(dv.dot(o.cov_velocity.inverse() * dv), 3);
  }
  return out;
}

}  // namespace

TEST_CASE("a lens off by its doubt is learnt, and speeds are what the covariance says") {
  const Outcome o = drive_all(kDrives, 1.0, 1.0);
  std::printf("doubted lens: lens %.3f velocity %.3f (%d drives)\n", o.lens.ratio(), o.velocity.ratio(), o.running);
  CHECK(o.running == kDrives);
  CHECK(o.lens.ratio() < 2.0);
  CHECK(o.lens.ratio() > 0.3);
  CHECK(o.velocity.ratio() < 1.6);
}

TEST_CASE("a lens that is right stays so: noise of the points does not pull it") {
  const Outcome o = drive_all(kDrives, 0.0, 1.0);
  std::printf("right lens: lens %.3f velocity %.3f\n", o.lens.ratio(), o.velocity.ratio());
  CHECK(o.lens.ratio() < 1.5);
  CHECK(o.velocity.ratio() < 1.6);
}

TEST_CASE("a lens off by its doubt and taken for right makes speeds that the covariance does not know") {
  const Outcome o = drive_all(kDrives, 1.0, 0.0);
  std::printf("trusted lens: velocity %.3f\n", o.velocity.ratio());
  CHECK(o.velocity.ratio() > 3.0);
}

TEST_CASE("a lens whose border bends the other way is not told by r^2 alone") {
  const Outcome o = drive_all(kDrives, 1.0, 1.0, 0.0);
  std::printf("without r^4: lens %.3f velocity %.3f\n", o.lens.ratio(), o.velocity.ratio());
  CHECK(o.lens.ratio() > 20.0);
}
