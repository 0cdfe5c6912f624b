// The state: retraction, growing and shrinking, the reference point, symmetry.
#include <catch2/catch.hpp>

#include "navigation/state.h"
#include "random_state.h"
#include "stream/state_bytes.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

State random_state(test::RandomNavigationState& random, int clones) {
  State s(true);
  s.reset(random.mean(0.3), BaseVector::Ones());
  Eigen::MatrixXd L(kBaseSize, kBaseSize);
  for (int i = 0; i < kBaseSize; ++i)
    for (int k = 0; k < kBaseSize; ++k) L(i, k) = 0.1 * random.number(1.0);
  const Eigen::MatrixXd P = L * L.transpose();
  s.P().topLeftCorner<kBaseSize, kBaseSize>() = 0.5 * (P + P.transpose());
  for (int i = 0; i < clones; ++i) {
    s.add_clone(i + 1, random.vector(0.3), 0.001);
    Eigen::VectorXd d = Eigen::VectorXd::Zero(s.size());
    for (int k = 0; k < 9; ++k) d(k) = random.number(0.3);
    s.retract(d);
  }
  return s;
}

bool symmetric(const State& s) {
  const auto P = s.P().topLeftCorner(s.size(), s.size());
  return P == P.transpose();
}

}  // namespace

TEST_CASE("retract and local are inverse, about any reference point") {
  test::RandomNavigationState random(1);
  for (int i = 0; i < 20; ++i) {
    const Mean x = random.mean(0.5), y = random.mean(0.5);
    const Eigen::Vector3d p_ref = random.vector(50.0);
    const BaseVector d = random.error(0.3);
    CHECK((local(x, retract(x, d, p_ref), p_ref) - d).norm() < 1e-10);
    CHECK(local(retract(x, local(x, y, p_ref), p_ref), y, p_ref).norm() < 1e-10);
  }
}

TEST_CASE("moving the reference point changes no pose's uncertainty, and is undone by moving it back") {
  test::RandomNavigationState random(2);
  State s = random_state(random, 3);
  const auto position_of_clone = [](const State& state) {  // covariance of an oldest clone's place in the level frame
    const Clone& c = state.clones.front();
    Eigen::Matrix<double, 3, 6> J;
    J << -skew(c.p - state.p_ref), Eigen::Matrix3d::Identity();
    return Eigen::Matrix3d(J * state.P().block<6, 6>(c.at, c.at) * J.transpose());
  };
  const Eigen::Matrix3d before = position_of_clone(s);
  const Eigen::MatrixXd P = s.P();
  const Eigen::Vector3d old = s.p_ref;
  s.move_reference(old + Eigen::Vector3d(30.0, -20.0, 5.0));
  CHECK((position_of_clone(s) - before).norm() < 1e-10 * before.norm());
  CHECK((s.P() - P).norm() > 1.0);  // teeth: the numbers are others
  CHECK(symmetric(s));
  s.move_reference(old);
  CHECK((s.P() - P).norm() < 1e-10 * P.norm());
}

TEST_CASE("a turn of everything about gravity is free of the reference point's motion") {
  // (N.1.6): phi = e_z, rho = 0 about p_ref becomes phi = e_z, rho = -[d]x e_z, for every pose alike.
  test::RandomNavigationState random(4);
  State s = random_state(random, 2);
  Eigen::VectorXd turn = Eigen::VectorXd::Zero(s.size());
  turn(kAtt + 2) = 1e-4;
  for (const Clone& c : s.clones) turn(c.at + 2) = 1e-4;
  State moved = s, turned = s;
  turned.retract(turn);
  const Eigen::Vector3d d(10.0, 4.0, 0.0);
  moved.move_reference(s.p_ref + d);
  Eigen::VectorXd same = turn;
  same.segment<3>(kPos) -= d.cross(Eigen::Vector3d(turn.segment<3>(kAtt)));
  for (const Clone& c : s.clones) same.segment<3>(c.at + 3) -= d.cross(Eigen::Vector3d(turn.segment<3>(c.at)));
  moved.retract(same);
  CHECK((moved.x.nav.position - turned.x.nav.position).norm() < 1e-6);
  CHECK((moved.clones[0].p - turned.clones[0].p).norm() < 1e-6);
}

TEST_CASE("updates and shrinking keep the covariance symmetric to the bit") {
  test::RandomNavigationState random(5);
  for (const int columns : {1, 3, 20}) {
    State s = random_state(random, 4);
    Eigen::MatrixXd Y(s.size(), columns);
    for (int j = 0; j < columns; ++j)
      for (int i = 0; i < s.size(); ++i) Y(i, j) = random.number(0.01);
    s.subtract(Y);
    CHECK(symmetric(s));
    (void)s.add_point(7, 3, random.vector(0.1));
    s.remove_clone(2);
    CHECK(s.size() == kBaseSize + 21);
    CHECK(s.points.front().at == kBaseSize + 18);
    s.remove_point(7);
    CHECK(s.size() == kBaseSize + 18);
    CHECK(symmetric(s));
    CHECK(s.find_clone(2) == nullptr);
    CHECK(s.clone(4).at == kBaseSize + 12);
  }
}

TEST_CASE("what tracks pretend decays in mean and correlations, and its variance settles") {
  test::RandomNavigationState random(9);
  State s = random_state(random, 3);
  s.carry(2);
  s.carried().setOnes();
  constexpr double kDecay = 0.9, kSettled = 4e-6;
  const Eigen::Vector3d mean = s.x.track_drift;
  const Eigen::MatrixXd before = s.P().topLeftCorner(s.size(), s.size());
  s.decay_track_drift(kDecay, (1.0 - kDecay * kDecay) * kSettled);
  CHECK((s.x.track_drift - kDecay * mean).norm() < 1e-15);
  CHECK(symmetric(s));
  CHECK(s.P()(kTrackDrift, kPos) == Approx(kDecay * before(kTrackDrift, kPos)));
  CHECK(s.P()(kTrackDrift, kTrackDrift + 1) == Approx(kDecay * kDecay * before(kTrackDrift, kTrackDrift + 1)));
  CHECK(s.P()(kCameraOffset, kCameraOffset) == before(kCameraOffset, kCameraOffset));  // teeth: its neighbour stays
  CHECK(s.carried()(kTrackDrift, 1) == kDecay);
  CHECK(s.carried()(kCameraOffset, 1) == 1.0);
  for (int i = 0; i < 300; ++i) s.decay_track_drift(kDecay, (1.0 - kDecay * kDecay) * kSettled);
  CHECK(s.P()(kTrackDrift, kTrackDrift) == Approx(kSettled));
}

TEST_CASE("a snapshot restores the state to the bit, and a wrong size is refused") {
  test::RandomNavigationState random(6);
  State s = random_state(random, 3);
  (void)s.add_point(7, 3, random.vector(0.1));
  StateArchiveOut out;
  s.serialise(out);
  const std::vector<uint8_t> bytes = out.out.take();
  State t(true);
  StateArchiveIn in{StateReader(bytes)};
  t.serialise(in);
  in.in.finish();
  CHECK(local(s.x, t.x, Eigen::Vector3d::Zero()).isZero(0.0));
  REQUIRE(t.points.size() == 1);
  CHECK(t.points.front().f == s.points.front().f);
  CHECK(t.points.front().track == 7);
  CHECK(t.P().topLeftCorner(t.size(), t.size()) == s.P().topLeftCorner(s.size(), s.size()));
  State small(false);
  StateArchiveIn again{StateReader(bytes)};
  CHECK_THROWS(small.serialise(again));
}

TEST_CASE("another level frame has the same errors, turned, and one more that all poses share") {
  test::RandomNavigationState random(9);
  State before = random_state(random, 3);
  before.carry(1);
  const double yaw = 2.1;
  const Eigen::Vector3d p(500.0, -200.0, 30.0);
  Eigen::VectorXd d(before.size());
  for (int i = 0; i < d.size(); ++i) d(i) = random.number(0.1);
  before.carried().col(0).head(d.size()) = d;
  State turned = before;
  turned.change_frame(yaw, p, 0.0, 0.0);
  // An error and the change of frame, in either order.
  State first = before, then = turned;
  first.retract(d);
  first.change_frame(yaw, p, 0.0, 0.0);
  then.retract(Eigen::VectorXd(turned.carried().col(0).head(d.size())));
  CHECK(local(first.x, then.x, turned.p_ref).norm() < 1e-9);
  for (size_t i = 0; i < first.clones.size(); ++i) {
    CHECK((first.clones[i].p - then.clones[i].p).norm() < 1e-9);
    CHECK((first.clones[i].R - then.clones[i].R).norm() < 1e-12);
  }
  CHECK(local(first.x, turned.x, turned.p_ref).norm() > 0.1);
  CHECK(symmetric(turned));
  const auto spectrum = [](const State& s) {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(s.P().topLeftCorner(s.size(), s.size())).eigenvalues().eval();
  };
  CHECK((spectrum(turned) - spectrum(before)).norm() < 1e-9 * spectrum(before).norm());
  // What is not known of the turn and the place makes no pose unsure against another.
  State unsure = before;
  unsure.change_frame(yaw, p, 0.3, 10.0);
  CHECK(symmetric(unsure));
  const auto apart = [](const State& s) {
    const Clone &a = s.clones.front(), &b = s.clones.back();
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, s.size());
    J.block<6, 6>(0, a.at).setIdentity();
    J.block<6, 6>(0, b.at) -= Matrix6d::Identity();
    return Eigen::MatrixXd(J * s.P().topLeftCorner(s.size(), s.size()) * J.transpose());
  };
  CHECK((apart(unsure) - apart(turned)).norm() < 1e-9);
  CHECK(unsure.P()(kAtt + 2, kAtt + 2) - turned.P()(kAtt + 2, kAtt + 2) == Approx(0.09));
  CHECK(unsure.P()(kPos, kPos) - turned.P()(kPos, kPos) == Approx(100.0));
}
