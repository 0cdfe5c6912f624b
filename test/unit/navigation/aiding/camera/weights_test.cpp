// Tracks that agree with each other against the street: a car that drives along is as likely a measurement to a state that
// knows its own speed badly.
#include <catch2/catch.hpp>

#include "camera_window.h"

using namespace roadfix;
using namespace roadfix::navigation;
using namespace roadfix::test;

namespace {

constexpr int kViews = 3;
constexpr double kSpeed = 0.03;  // m from one view to the next, standard deviation each way

/// Poses off by what a speed makes of them.
Eigen::MatrixXd covariance(int columns) {
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(columns, columns);
  P.diagonal().setConstant(1e-8);
  for (int i = 0; i < kViews; ++i)
    for (int j = 0; j < kViews; ++j)
      P.block<3, 3>(TrackColumns::of_view(i) + 3, TrackColumns::of_view(j) + 3) +=
          i * j * kSpeed * kSpeed * Eigen::Matrix3d::Identity();
  return P;
}

void add_street(TrackUpdate& update, const TrackWindow& truth, RandomStream& random) {
  for (int k = 0; k < 20; ++k) {
    const Eigen::Vector2d z(0.5 * random.normal(), 0.2 * random.normal());
    auto seen = sightings(truth, point_at(truth, z, 10.0 + 20.0 * random.uniform()), false);
    for (ViewSighting& s : seen) {
      s.sigma_px = 0.3;
      s.left.z += s.sigma_px / s.left.px * draw(random, 1.0).head<2>();
    }
    (void)update.add(seen);
  }
}

/// Three points of a car that comes nearer by 3 m from view to view.
void add_car(TrackUpdate& update, const TrackWindow& truth, RandomStream& random) {
  for (int k = 0; k < 3; ++k) {
    const double aside = -0.12 + 0.02 * random.uniform(), above = 0.02 * random.uniform();
    std::vector<ViewSighting> seen;
    for (int i = 0; i < kViews; ++i) {
      const double depth = 18.0 - 3.0 * i;
      const Eigen::Vector3d point = point_at(truth, Eigen::Vector2d(aside, above) * 18.0 / depth, depth);
      seen.push_back(sighting(truth.camera, truth.views[static_cast<size_t>(i)], i, point, false, 500.0));
      seen.back().sigma_px = 0.3;
    }
    (void)update.add(seen);
  }
}

struct Outcome {
  double moved = 0.0;  ///< RMS over windows of the last pose's correction over what it claims to be left of it
  double used = 0.0;   ///< share of the car's tracks that were not refused
};

Outcome outcome(bool car, bool together) {
  constexpr int kWindows = 40;
  Outcome out;
  for (uint64_t seed = 1; seed <= kWindows; ++seed) {
    TrackWindow window = window_along(kViews, 0.5, 0.0, {3.0, 0.0, 0.0}, seed);
    const int n = window.columns();
    window.P = covariance(n);
    RandomStream random(seed, 0x5EE);
    TrackUpdate update(TrackTuning{}, 40);
    update.begin(window);
    add_street(update, window, random);
    const int street = update.counts().used;
    if (car) add_car(update, window, random);
    out.used += (update.counts().used - street) / 3.0 / kWindows;
    if (together) update.weigh_together();
    const Eigen::MatrixXd rows = update.rows();
    const Eigen::MatrixXd H = rows.leftCols(n);
    Eigen::MatrixXd S = H * window.P * H.transpose();
    S.diagonal().array() += 1.0;
    const Eigen::MatrixXd K = window.P * H.transpose() * S.inverse();
    const int at = TrackColumns::of_view(kViews - 1) + 3;
    const Eigen::Vector3d d = (K * rows.rightCols<1>()).segment<3>(at);
    const Eigen::Matrix3d left = (window.P - K * H * window.P).block<3, 3>(at, at);
    out.moved += d.dot(left.inverse() * d) / 3.0 / kWindows;  // the truth is where the window stands
  }
  out.moved = std::sqrt(out.moved);
  return out;
}

}  // namespace

TEST_CASE("tracks of a car that agree with each other do not move what the street holds") {
  const Outcome car = outcome(true, true);
  CHECK(car.used > 0.3);  // to the state alone they are tracks like others
  CHECK(car.moved < 1.2);
  CHECK(outcome(true, false).moved > 4.0);  // by the state alone
  // Where all are of the street it changes little.
  CHECK(std::abs(outcome(false, true).moved - outcome(false, false).moved) < 0.1);
}
