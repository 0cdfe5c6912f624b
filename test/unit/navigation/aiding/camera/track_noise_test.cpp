// Errors that walk along a track: what makes them white, how they are kept, and whether an update's claim holds.
#include <catch2/catch.hpp>

#include "camera_window.h"
#include "navigation/aiding/camera/track_store.h"

using namespace roadfix;
using namespace roadfix::navigation;
using namespace roadfix::test;

namespace {

constexpr int kViews = 10;
constexpr double kTold = 0.1;  // of the variance before, that a direction has left when tracks have told it

/// Covariance of the u of left and right places in the order of the rows of linearise_track; v is alike.
Eigen::MatrixXd covariance_of(const std::vector<ViewSighting>& seen) {
  const auto n = static_cast<int>(2 * seen.size());
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(n, n);
  std::vector<double> walked(seen.size(), 0.0);
  for (size_t i = 1; i < seen.size(); ++i) walked[i] = walked[i - 1] + seen[i].walk_px2;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const auto a = static_cast<size_t>(i / 2), b = static_cast<size_t>(j / 2);
      R(i, j) = walked[std::min(a, b)];
      if (a != b) continue;
      R(i, j) += seen[a].sigma_px * seen[a].sigma_px;
      if (i % 2 == 1 && j % 2 == 1) R(i, j) += seen[a].right_sigma_px * seen[a].right_sigma_px;
    }
  }
  return R;
}

/// What whitening does to the u rows, as a matrix.
Eigen::MatrixXd whitening_of(const std::vector<ViewSighting>& seen) {
  const auto n = static_cast<int>(2 * seen.size());
  Eigen::MatrixXd work = Eigen::MatrixXd::Zero(2 * n, n);
  for (int i = 0; i < n; ++i) work(4 * (i / 2) + 2 * (i % 2), i) = 1.0;
  whiten_track(seen, true, work);
  Eigen::MatrixXd L(n, n);
  for (int i = 0; i < n; ++i) L.row(i) = work.row(4 * (i / 2) + 2 * (i % 2));
  return L;
}

std::vector<ViewSighting> some_noise() {
  std::vector<ViewSighting> seen(6);
  for (size_t i = 0; i < seen.size(); ++i) {
    seen[i].right = EyePoint{};
    seen[i].sigma_px = 0.1 + 0.02 * static_cast<double>(i);
    seen[i].walk_px2 = 0.05 / (1.0 + static_cast<double>(i));
    seen[i].right_sigma_px = 0.3;
  }
  return seen;
}

void set_noise(std::vector<ViewSighting>& seen, double sigma_px, double walk_px) {
  for (ViewSighting& s : seen) {
    s.sigma_px = sigma_px;
    s.walk_px2 = walk_px * walk_px;
    s.right_sigma_px = 0.2;
  }
}

/// Adds errors of the noise that the sightings say.
void add_noise(std::vector<ViewSighting>& seen, RandomStream& random) {
  const auto pair = [&random] {
    const double u = random.normal(), v = random.normal();
    return Eigen::Vector2d(u, v);
  };
  Eigen::Vector2d walk = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < seen.size(); ++i) {
    ViewSighting& s = seen[i];
    if (i > 0) walk += std::sqrt(s.walk_px2) * pair();
    const Eigen::Vector2d left = walk + s.sigma_px * pair();
    s.left.z += left / s.left.px;
    if (s.right) s.right->z += (left + s.right_sigma_px * pair()) / s.right->px;
  }
}

struct Claim {
  double nees = 0.0, nis = 0.0;
  int dof = 0;
};

/// Windows off by what their covariance says, corrected by tracks with errors that walk; `told_*`: what the filter is
/// told of these.
Claim claim(double told_sigma_px, double told_walk_px) {
  constexpr int kSeeds = 50, kTracks = 80;
  Claim sum;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    TrackWindow truth = window_along(kViews, 0.7, 0.02, {20.0, 5.0, 1.0}, seed);
    RandomStream random(seed, 0xC1A1);
    const int n = truth.columns();
    Eigen::VectorXd sigma = Eigen::VectorXd::Zero(n);
    sigma.segment<3>(TrackColumns::kTurn).setConstant(1e-3);
    for (int i = 0; i < kViews; ++i) {
      sigma.segment<3>(TrackColumns::of_view(i)).setConstant(2e-4);
      sigma.segment<3>(TrackColumns::of_view(i) + 3).setConstant(0.02);
    }
    Eigen::VectorXd d(n);
    for (int k = 0; k < n; ++k) d(k) = sigma(k) * random.normal();
    TrackWindow estimate = moved(truth, -d);
    estimate.P = sigma.cwiseAbs2().asDiagonal();
    TrackTuning tuning;
    tuning.refuse = 1e9;
    tuning.tails = 1e9;
    TrackUpdate update(tuning, 200);
    update.begin(estimate);
    for (int k = 0; k < kTracks; ++k) {
      const Eigen::Vector2d z(0.3 * random.normal(), 0.1 * random.normal());
      auto seen = sightings(truth, point_at(truth, z, 12.0 + 20.0 * random.uniform()), k % 2 == 0);
      set_noise(seen, 0.1, 0.15);
      add_noise(seen, random);
      set_noise(seen, told_sigma_px, told_walk_px);
      (void)update.add(seen);
    }
    REQUIRE(update.counts().used > kTracks / 2);
    const Eigen::MatrixXd rows = update.rows();
    const Eigen::MatrixXd H = rows.leftCols(n);
    Eigen::MatrixXd S = H * estimate.P * H.transpose();
    S.diagonal().array() += 1.0;
    const Eigen::MatrixXd K = estimate.P * H.transpose() * S.inverse();
    const Eigen::VectorXd left = d - K * rows.rightCols<1>();
    const Eigen::MatrixXd P = estimate.P - K * H * estimate.P;
    // Along the directions of the poses that the tracks have told most of.
    const int at = TrackColumns::of_view(0), size = 6 * kViews;
    const Eigen::VectorXd scale = sigma.segment(at, size).cwiseInverse();
    const Eigen::MatrixXd told = scale.asDiagonal() * P.block(at, at, size, size) * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(0.5 * (told + told.transpose()));
    const Eigen::VectorXd e = axes.eigenvectors().transpose() * scale.cwiseProduct(left.segment(at, size));
    for (int k = 0; k < size && axes.eigenvalues()(k) < kTold; ++k, ++sum.dof)
      sum.nees += e(k) * e(k) / axes.eigenvalues()(k);
    sum.nis += update.counts().nis_sum / update.counts().dof_sum / kSeeds;
  }
  sum.nees /= sum.dof;
  return sum;
}

}  // namespace

TEST_CASE("rows of a track with a walk become white, with both eyes") {
  const std::vector<ViewSighting> seen = some_noise();
  const Eigen::MatrixXd R = covariance_of(seen);
  const Eigen::MatrixXd L = whitening_of(seen);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(R.rows(), R.cols());
  CHECK((L * R * L.transpose() - identity).norm() < 1e-9);
  std::vector<ViewSighting> white = seen;  // teeth: without the walk
  for (ViewSighting& s : white) s.walk_px2 = 0.0;
  CHECK_FALSE((whitening_of(white) * R * whitening_of(white).transpose() - identity).norm() < 0.5);
}

TEST_CASE(
    "an update by tracks whose errors walk claims what it is worth, and too much where they are taken for white") {
  const Claim walk = claim(0.1, 0.15);
  CHECK(walk.dof > 500);
  CHECK(walk.nees > 0.8);
  CHECK(walk.nees < 1.2);
  CHECK(walk.nis > 0.95);
  CHECK(walk.nis < 1.05);
  const Claim white = claim(0.1, 0.0);
  CHECK(white.nees > 1.6);
}

TEST_CASE("a track's walk goes on through pictures without a pose and through poses that are forgotten") {
  const auto picture = [](std::initializer_list<int64_t> tracks) {
    SeenPicture p;
    for (const int64_t id : tracks) p.points.push_back({.track = id, .left = {}, .right = {}, .walk_px = 0.5});
    return p;
  };
  TrackStore store;
  store.add(picture({1, 2}), 1);
  store.pass(picture({1, 2}));
  store.add(picture({1, 2, 5}), 2);
  store.add(picture({1, 5}), 3);
  REQUIRE(store.tracks().size() == 3);
  CHECK(store.tracks()[0].count == 3);
  CHECK(store.tracks()[0].seen[1].walk_px2 == Approx(0.5));  // two pictures
  CHECK(store.tracks()[0].seen[2].walk_px2 == Approx(0.25));
  CHECK_FALSE(store.tracks()[1].alive);
  store.forget_clone(2);
  CHECK(store.tracks()[0].count == 2);
  CHECK(store.tracks()[0].seen[1].walk_px2 == Approx(0.75));
  store.forget_clone(3);
  CHECK(store.tracks()[0].walk_px2 == Approx(0.75));  // until the next sighting
  store.add(picture({1, 5}), 4);
  CHECK(store.tracks()[0].seen[1].walk_px2 == Approx(1.0));
  store.drop_ended();
  REQUIRE(store.tracks().size() == 2);
  CHECK(store.tracks()[1].track == 5);
}
