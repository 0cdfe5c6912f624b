#include "fusion/measurement.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "draws.h"
#include "geometry/so3.h"
#include "support/numerical_jacobian.h"

namespace roadfix {

using namespace fusion;

namespace {

using test::Draws;
using test::random_estimate;

const ChannelSlots kVision{kVoClone, kVoScale, kVoTurns, std::nullopt, std::nullopt};
const ChannelSlots kInertial{kInsClone, std::nullopt, std::nullopt, kInsDrift, kInsVelocity};

/// x + d, but a velocity error turns with the yaw of its clone, (F.11h).
Vector turned_plus(const Vector& x, const Vector& d, const ChannelSlots& slots) {
  Vector y = plus(x, d);
  if (!slots.velocity) return y;
  const int e = *slots.velocity;
  y.segment<2>(e) = Eigen::Rotation2Dd(d(slots.clone + 2)) * x.segment<2>(e) + d.segment<2>(e);
  return y;
}

TEST_CASE("Jacobian of the relative motion, scale, turns and drift included") {
  Draws draws(1);
  for (int i = 0; i < 21; ++i) {
    const Vector x = random_estimate(draws).x;
    const Planar motion = draws.vector<3>(0.5);
    for (const ChannelSlots& slots : {kVision, kInertial}) {
      const auto h = [&](const Vector& d) {
        return Eigen::Vector3d(
            -relative_motion(turned_plus(x, d, slots), slots, motion, 0.3, Eigen::Matrix3d::Identity()).innovation);
      };
      const FusionMeasurement<3> m = relative_motion(x, slots, motion, 0.3, Eigen::Matrix3d::Identity());
      CHECK((m.H - test::numerical_jacobian<3, kSize>(h, 1e-5)).cwiseAbs().maxCoeff() < 1e-7);
    }
  }
}

TEST_CASE("motion in the vehicle's axes says nothing of the yaw, whatever its velocity error is") {
  Draws draws(12);
  for (int i = 0; i < 20; ++i) {
    const Vector x = random_estimate(draws).x;
    const FusionMeasurement<3> m =
        relative_motion(x, kInertial, draws.vector<3>(0.5), 0.3, Eigen::Matrix3d::Identity());
    // All that stands in ENU turns about the origin.
    Vector all = Vector::Zero();
    for (const int at : {kPos + 0, kInsClone + 0}) all.segment<3>(at) << -x(at + 1), x(at), 1.0;
    CHECK((m.H * all).norm() < 1e-12);
    // An error of e in ENU axes would have e turn by itself, and be seen.
    Vector fixed = all;
    fixed.segment<2>(kInsVelocity) << x(kInsVelocity + 1), -x(kInsVelocity);
    CHECK((m.H * fixed).norm() > 0.2 * x.segment<2>(kInsVelocity).norm());
  }
}

TEST_CASE("Jacobians of planar motion") {
  Draws draws(2);
  for (int i = 0; i < 20; ++i) {
    const Planar a = draws.vector<3>(1.0), b = draws.vector<3>(1.0), m = draws.vector<3>(1.0);
    const auto by_a = [&](const Eigen::Vector3d& d) { return motion_between(a + d, b); };
    const auto by_b = [&](const Eigen::Vector3d& d) { return motion_between(a, b + d); };
    const auto after = [&](const Eigen::Vector3d& d) { return after_motion(a + d, m); };
    CHECK((motion_by_start(a, b) - test::numerical_jacobian<3, 3>(by_a)).norm() < 1e-7);
    CHECK((motion_by_end(a) - test::numerical_jacobian<3, 3>(by_b)).norm() < 1e-7);
    CHECK((after_motion_by_start(a, m) - test::numerical_jacobian<3, 3>(after)).norm() < 1e-7);
    CHECK((after_motion(a, motion_between(a, b)) - Planar(b.x(), b.y(), wrap_angle(b.z()))).norm() < 1e-12);
  }
}

TEST_CASE("a cloned pose is correlated as the pose is, and moves with it") {
  Draws draws(3);
  FusionEstimate e = random_estimate(draws);
  clone_pose(e, kVoClone);
  CHECK(e.P.block<3, 3>(kVoClone, kVoClone) == e.P.block<3, 3>(kPos, kPos));
  CHECK(e.P.block<3, 3>(kVoClone, kPos) == e.P.block<3, 3>(kPos, kPos));
  // Their difference is exactly known, so measuring "no motion" tells nothing of the place.
  const FusionEstimate before = e;
  const FusionMeasurement<3> m =
      relative_motion(e.x, {kVoClone, std::nullopt, std::nullopt, std::nullopt, std::nullopt}, Planar::Zero(), 0.1,
                      1e-4 * Eigen::Matrix3d::Identity());
  (void)kalman_update<3>(e, m.H, m.innovation, m.R);
  CHECK((e.P - before.P).norm() < 1e-9);
}

TEST_CASE("motion carried on is the update of a pose of which no model knows anything") {
  Draws draws(6);
  for (int i = 0; i < 20; ++i) {
    FusionEstimate carried = random_estimate(draws);
    FusionEstimate updated = carried;
    const Planar motion = draws.vector<3>(0.5);
    const Eigen::Matrix3d R = Eigen::Vector3d(1e-4, 4e-4, 1e-6).asDiagonal();
    carry_on(carried, motion, 0.3, R, true);
    // Independent of all else and unknown; linearised where the update ends, for it is not linear in the yaw.
    for (int k = 0; k < 3; ++k) set_independent(updated, kPos + k, carried.x(kPos + k), 1e4);
    const FusionMeasurement<3> m = relative_motion(updated.x, kInertial, motion, 0.3, R);
    CHECK(m.innovation.norm() < 1e-12);
    (void)kalman_update<3>(updated, m.H, m.innovation, m.R);
    CHECK((carried.x - updated.x).norm() < 1e-9);
    CHECK((carried.P - updated.P).norm() < 1e-5 * carried.P.norm());
    // What a model knows is used by the update and not by this.
    FusionEstimate known = random_estimate(draws);
    const FusionEstimate before = known;
    carry_on(known, motion, 0.3, R, true);
    CHECK((known.x - before.x).segment<3>(kPos).norm() > 0.1);
    CHECK((known.x - before.x).tail<kSize - 3>().norm() == 0.0);
  }
}

TEST_CASE("a pose that goes on beside the fused one tells what the relative motion tells") {
  Draws draws(8);
  for (int i = 0; i < 20; ++i) {
    FusionEstimate start = random_estimate(draws);
    // The place is where the speed takes the clone: no innovation, and both are linearised alike.
    const double way = 0.1 * start.x(kSpeed), turn = 0.1 * start.x(kTurn);
    start.x.segment<3>(kPos) =
        after_motion(start.x.segment<3>(kVoClone), {way * std::cos(0.5 * turn), way * std::sin(0.5 * turn), turn});
    const Planar motion = predicted_motion(start.x, kVision, 0.1);
    const Eigen::Matrix3d R = Eigen::Vector3d(1e-3, 2e-3, 1e-4).asDiagonal();
    const auto beside = [&](double white) {
      FusionEstimate e = start;
      carry_clone(e, kVision, motion, 0.1, R);
      const FusionMeasurement<3> m = same_pose(e.x, kVision, white * Eigen::Matrix3d::Identity());
      CHECK(m.innovation.norm() < 1e-9);
      (void)kalman_update<3>(e, m.H, m.innovation, m.R);
      // The clone itself has moved: all else is compared.
      for (int k = 0; k < 3; ++k) set_independent(e, kVoClone + k, 0.0, 0.0);
      return e.P;
    };
    FusionEstimate relative = start;
    const FusionMeasurement<3> m = relative_motion(start.x, kVision, motion, 0.1, R);
    (void)kalman_update<3>(relative, m.H, m.innovation, m.R);
    for (int k = 0; k < 3; ++k) set_independent(relative, kVoClone + k, 0.0, 0.0);
    CHECK((beside(0.0) - relative.P).norm() < 0.01 * relative.P.norm());
    CHECK((beside(1.0) - relative.P).norm() > 0.03 * relative.P.norm());
  }
}

/// The scale's estimate in its own sigmas after 2000 pictures of a vision without scale error, each off by 5 cm anew,
/// beside a place of which nobody else tells. `linearised` mixes the measured way into the speed that carry_clone uses.
double scale_seen(double linearised) {
  constexpr double kDt = 0.1, kSpeedTrue = 8.0, kPicture = 0.05, kModel = 0.05, kScaleStd = 0.1;
  Draws draws(21);
  FusionEstimate e;
  set_independent(e, kVoScale, 0.0, kScaleStd);
  const ChannelSlots slots{kVoClone, kVoScale, std::nullopt, std::nullopt, std::nullopt};
  const Eigen::Matrix3d white = Eigen::Vector3d(kPicture * kPicture, kPicture * kPicture, 1e-8).asDiagonal();
  double last = 0.0;
  for (int i = 0; i < 2000; ++i) {
    e.x(kPos) += kDt * kSpeedTrue * std::exp(-e.x(kVoScale));  // the model's speed has come from the vision
    e.P.row(kPos) -= kDt * kSpeedTrue * e.P.row(kVoScale);
    e.P.col(kPos) -= kDt * kSpeedTrue * e.P.col(kVoScale);
    e.P(kPos, kPos) += kModel * kModel;
    const double picture = draws.normal(kPicture), way = kDt * kSpeedTrue + picture - last;
    last = picture;
    e.x(kSpeed) = (1.0 - linearised) * kSpeedTrue + linearised * way / kDt;
    carry_clone(e, slots, {way, 0.0, 0.0}, kDt, 1e-6 * Eigen::Matrix3d::Identity());
    const FusionMeasurement<3> m = same_pose(e.x, slots, white);
    (void)kalman_update<3>(e, m.H, m.innovation, m.R);
  }
  return e.x(kVoScale) / kScaleStd;
}

TEST_CASE("what pictures err by anew does not shorten the lengths") {
  const double seen = scale_seen(0.0), measured = scale_seen(1.0);
  INFO(seen << " sigma; linearised at the measured way " << measured);
  CHECK(std::abs(seen) < 0.3);
  CHECK(measured > 1.0);  // teeth
}

/// The same of the turns' share on a straight road, each picture off by 0.05 deg anew. `linearised` mixes the measured
/// turn into the yaw that carry_clone uses.
double turns_seen(double linearised) {
  constexpr double kDt = 0.1, kPicture = 1e-3, kModel = 1e-4, kWalk = 2e-4, kTurnsStd = 0.003;
  Draws draws(22);
  FusionEstimate e;
  set_independent(e, kVoTurns, 0.0, kTurnsStd);
  const Eigen::Matrix3d white = Eigen::Vector3d(1e-4, 1e-4, kPicture * kPicture).asDiagonal();
  const Eigen::Matrix3d R = Eigen::Vector3d(1e-6, 1e-6, kWalk * kWalk).asDiagonal();
  double last = 0.0;
  for (int i = 0; i < 2000; ++i) {
    e.P(kYaw, kYaw) += kModel * kModel;
    const double picture = draws.normal(kPicture), turn = picture - last + draws.normal(kWalk);
    last = picture;
    const double yaw = e.x(kYaw);
    e.x(kYaw) += linearised * (e.x(kVoClone + 2) + turn - yaw);
    carry_clone(e, kVision, {0.0, 0.0, turn}, kDt, R);
    e.x(kYaw) = yaw;
    const FusionMeasurement<3> m = same_pose(e.x, kVision, white);
    (void)kalman_update<3>(e, m.H, m.innovation, m.R);
  }
  return e.x(kVoTurns) / kTurnsStd;
}

TEST_CASE("what pictures err by anew is no share of a turn") {
  const double seen = turns_seen(0.0), measured = turns_seen(1.0);
  INFO(seen << " sigma; linearised at the measured turn " << measured);
  CHECK(std::abs(seen) < 0.3);
  CHECK(std::abs(measured) > 1.0);  // teeth
}

Eigen::Matrix<double, 1, kSize> dense(const ScalarMeasurement& m) {
  Eigen::Matrix<double, 1, kSize> H = Eigen::Matrix<double, 1, kSize>::Zero();
  for (std::size_t k = 0; k < static_cast<std::size_t>(m.count); ++k) H(m.index[k]) = m.h[k];
  return H;
}

TEST_CASE("two numbers told in one walk over the covariance are two updates") {
  Draws draws(23);
  for (int i = 0; i < 20; ++i) {
    FusionEstimate together = random_estimate(draws);
    set_cloned(together, i % 2 == 0);
    FusionEstimate apart = together, wrong = together;
    const ScalarUpdate turn = begin_update(together, told_turn(together.x, 0.1, 0.01));
    const ScalarMeasurement speed = told_speed(together.x, kInertial, 5.0, 0.01);
    const ScalarUpdate then = begin_update(together, speed, &turn);
    finish_update(together, turn, then);
    const auto update = [](FusionEstimate& e, const ScalarMeasurement& m) {
      const Eigen::Matrix<double, 1, 1> d(m.innovation), R(m.variance);
      return kalman_update<1>(e, dense(m), d, R);
    };
    update(apart, told_turn(apart.x, 0.1, 0.01));
    const FusionInnovation<1> last = update(apart, told_speed(apart.x, kInertial, 5.0, 0.01));
    CHECK((together.x - apart.x).norm() < 1e-12);
    CHECK((together.P - apart.P).norm() < 1e-12);
    CHECK(then.log_likelihood() == Approx(last.log_likelihood).epsilon(1e-12));
    finish_update(wrong, turn, begin_update(wrong, speed));  // teeth: the second does not know of the first
    CHECK((wrong.P - apart.P).norm() > 1e-6);
  }
}

TEST_CASE("a clone that is the pose itself needs no rows of its own") {
  Draws draws(24);
  const MotionNoise noise;
  for (const MotionKind kind : {MotionKind::kConstantAcceleration, MotionKind::kConstantTurn}) {
    for (const bool with_yaw : {true, false}) {
      FusionEstimate clone = random_estimate(draws);
      clone_pose(clone, kInsClone);
      FusionEstimate none = clone;
      set_cloned(none, false);
      PoseBefore before;
      move(clone, kind, noise, 0.01);
      move(none, kind, noise, 0.01, &before);
      const Planar motion = draws.vector<3>(0.5);
      const Eigen::Matrix3d R = Eigen::Vector3d(1e-4, 4e-4, 1e-6).asDiagonal();
      const CarriedOn a = carry_on(clone, motion, 0.01, R, with_yaw);
      const CarriedOn b = carry_on(none, before, motion, 0.01, R, with_yaw);
      CHECK(a.innovation.nis == Approx(b.innovation.nis).epsilon(1e-12));
      clone_pose(clone, kInsClone);
      set_cloned(none, true);
      CHECK((clone.x - none.x).norm() < 1e-12);
      CHECK((clone.P - none.P).norm() < 1e-12);
    }
  }
}

TEST_CASE("Jacobian of a channel's speed, with its scale or its velocity error") {
  Draws draws(22);
  for (int i = 0; i < 20; ++i) {
    const Vector x = random_estimate(draws).x;
    for (const ChannelSlots& slots : {kVision, kInertial}) {
      const auto h = [&](const Vector& d) {
        Vector moved = plus(x, d);
        if (slots.velocity)  // turns with the yaw, (F.11h)
          moved.segment<2>(kInsVelocity) =
              Eigen::Rotation2Dd(d(kYaw)) * x.segment<2>(kInsVelocity) + d.segment<2>(kInsVelocity);
        return Eigen::Matrix<double, 1, 1>(-told_speed(moved, slots, 5.0, 0.01).innovation);
      };
      const ScalarMeasurement m = told_speed(x, slots, 5.0, 0.01);
      CHECK((dense(m) - test::numerical_jacobian<1, kSize>(h, 1e-5)).cwiseAbs().maxCoeff() < 1e-7);
    }
  }
}

TEST_CASE("the gained measurement takes the estimate to the pose and its covariance") {
  Draws draws(4);
  FusionEstimate e = random_estimate(draws);
  const Eigen::Matrix3d P = e.P.block<3, 3>(kPos, kPos);
  const Eigen::Matrix3d better = 0.3 * P;
  const Planar pose = e.x.segment<3>(kPos) + Planar(0.1, -0.2, 0.05);
  const auto gain = gained_pose(planar_estimate(e), pose, better, 0.1);
  REQUIRE(gain);
  (void)kalman_update<3>(e, gain->H, gain->innovation, gain->R);
  CHECK((e.x.segment<3>(kPos) - pose).norm() < 1e-9);
  CHECK((e.P.block<3, 3>(kPos, kPos) - better).norm() < 1e-9);
}

TEST_CASE("what is not better is not used, direction by direction") {
  FusionEstimate e;
  e.P.setIdentity();
  CHECK(!gained_pose(planar_estimate(e), {1.0, 1.0, 0.1}, Eigen::Matrix3d::Identity(), 0.1));
  CHECK(!gained_pose(planar_estimate(e), {1.0, 1.0, 0.1}, 4.0 * Eigen::Matrix3d::Identity(), 0.1));
  const auto gain = gained_pose(planar_estimate(e), {1.0, 1.0, 0.1}, Eigen::Vector3d(0.25, 4.0, 4.0).asDiagonal(), 0.1);
  REQUIRE(gain);
  (void)kalman_update<3>(e, gain->H, gain->innovation, gain->R);
  CHECK(e.x(kPos) == Approx(1.0));
  CHECK(e.P(kPos, kPos) == Approx(0.25));
  CHECK(std::abs(e.x(kPos + 1)) < 1e-9);
  CHECK(e.P(kPos + 1, kPos + 1) == Approx(1.0));
}

TEST_CASE("the same information twice is used once") {
  FusionEstimate e;
  e.P = 4.0 * Matrix::Identity();
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  const auto first = gained_pose(planar_estimate(e), {0.5, 0.0, 0.0}, R, 0.1);
  REQUIRE(first);
  (void)kalman_update<3>(e, first->H, first->innovation, first->R);
  CHECK(!gained_pose(planar_estimate(e), {0.5, 0.0, 0.0}, R, 0.1));
}

TEST_CASE("infinite variance has no effect, to the bit") {
  Draws draws(5);
  FusionEstimate e = random_estimate(draws);
  const FusionEstimate before = e;
  FusionMeasurement<3> m = absolute_pose(e.x, {5.0, 5.0, 1.0}, Eigen::Matrix3d::Identity());
  m.R.diagonal().setConstant(std::numeric_limits<double>::infinity());
  CHECK(kalman_update<3>(e, m.H, m.innovation, m.R).log_likelihood == 0.0);
  CHECK(e.x == before.x);
  CHECK(e.P == before.P);
}

}  // namespace
}  // namespace roadfix
