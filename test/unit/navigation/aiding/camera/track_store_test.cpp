// What a window's poses are chosen by: parallax, whatever the camera turns meanwhile.
#include "navigation/aiding/camera/track_store.h"

#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "simulation/random.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr int64_t kFirstClone = 7;

/// Points 8 to 12 m ahead of a camera at `p`, turned by R to the axes of the first one.
SeenPicture picture_from(int points, const Eigen::Vector3d& p, const Eigen::Matrix3d& R) {
  RandomStream random(3, 0x57E0);
  SeenPicture seen;
  for (int i = 0; i < points; ++i) {
    const double x = random.uniform() - 0.5, y = random.uniform() - 0.5, depth = 8.0 + 4.0 * random.uniform();
    const Eigen::Vector2d z(0.8 * x, 0.4 * y);
    const Eigen::Vector3d h = R.transpose() * (depth * z.homogeneous() - p);
    SeenPoint& point = seen.points.emplace_back();
    point.track = i;
    point.left.z = h.head<2>() / h.z();
  }
  return seen;
}

TrackStore seen_once(int points) {
  TrackStore store;
  store.add(picture_from(points, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()), kFirstClone);
  return store;
}

}  // namespace

TEST_CASE("tracks of a camera that turns have no parallax, those of one that moves have theirs, (N.6.21)") {
  const TrackStore store = seen_once(40);
  const Eigen::Matrix3d turn = exp_so3({0.02, 0.15, -0.05});  // now's axes to the first one's
  CHECK(*store.parallax(picture_from(40, Eigen::Vector3d::Zero(), turn), kFirstClone, turn.transpose()) < 1e-9);
  // Half a metre aside of points 10 m away, whether it turns or not.
  const Eigen::Vector3d aside(0.5, 0.0, 0.0);
  const Eigen::Matrix3d none = Eigen::Matrix3d::Identity();
  CHECK(*store.parallax(picture_from(40, aside, none), kFirstClone, none) == Approx(0.05).margin(0.008));
  CHECK(*store.parallax(picture_from(40, aside, turn), kFirstClone, turn.transpose()) == Approx(0.05).margin(0.012));
  // The sibling: a turn that is not told passes for parallax.
  CHECK(*store.parallax(picture_from(40, Eigen::Vector3d::Zero(), turn), kFirstClone, none) > 0.1);
}

TEST_CASE("few tracks, or none since that pose, tell no parallax") {
  const Eigen::Matrix3d none = Eigen::Matrix3d::Identity();
  const auto now = [&](int points) { return picture_from(points, Eigen::Vector3d::UnitX(), none); };
  CHECK(seen_once(10).parallax(now(10), kFirstClone, none));
  CHECK_FALSE(seen_once(9).parallax(now(9), kFirstClone, none));
  CHECK_FALSE(seen_once(40).parallax(now(40), kFirstClone + 1, none));
  TrackStore ended = seen_once(40);
  ended.pass(SeenPicture{});
  CHECK_FALSE(ended.parallax(now(40), kFirstClone, none));
}
