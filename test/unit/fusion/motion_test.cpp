/// What a sample tells of the motion since the one before: its covariance less what is shared, and its velocities.
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "draws.h"
#include "fusion/measurement.h"
#include "geometry/euler.h"

namespace roadfix {

using namespace fusion;

namespace {

using test::Draws;
using test::random_estimate;

TEST_CASE("growth of a covariance becomes the covariance of the motion, and learning does not make it negative") {
  const Planar a(0.0, 0.0, 0.5), motion(2.0, 0.0, 0.1);
  const Eigen::Matrix3d P = Eigen::Vector3d(0.04, 0.04, 1e-4).asDiagonal();
  const Eigen::Matrix3d carry = after_motion_by_start(a, motion);
  const Eigen::Matrix3d Q = Eigen::Vector3d(0.01, 0.02, 1e-5).asDiagonal();  // in a's axes
  const Eigen::Matrix3d to_frame = motion_by_end(a).transpose();
  const Eigen::Matrix3d grown = carry * P * carry.transpose() + to_frame * Q * to_frame.transpose();
  CHECK((motion_covariance(a, P, motion, grown, {1e-3, 1e-3, 1e-4}) - Q).norm() < 1e-9);
  const Eigen::Matrix3d learnt = motion_covariance(a, P, motion, 0.1 * P, {1e-3, 1e-3, 1e-4});
  CHECK((learnt - Eigen::Vector3d(1e-6, 1e-6, 1e-8).asDiagonal().toDenseMatrix()).norm() < 1e-12);
}

TEST_CASE("a velocity whose error lasts adds up to what it has in common with the place, not to a sum of steps") {
  // A velocity that walks, and is measured now and then; the place is led by it and never corrected.
  constexpr double kStep = 0.1, kWalk = 0.01, kMeasured = 0.01;  // s, (m/s)2 per s, (m/s)2
  constexpr double kYaw = 0.7;
  Eigen::Matrix2d P = Eigen::Vector2d(0.0, 0.04).asDiagonal();  // of place and velocity, along or across
  LastingVelocity lasting;
  lasting.carry(kYaw, 0.0, {P(1, 1), 4.0 * P(1, 1), 9.0 * P(1, 1)});
  Eigen::Vector3d told = Eigen::Vector3d::Zero();
  double steps = 0.0;
  for (int i = 0; i < 300; ++i) {
    told += lasting.grown(kYaw, kStep);
    steps += kStep * kStep * P(1, 1);
    const Eigen::Matrix2d F = (Eigen::Matrix2d() << 1.0, kStep, 0.0, 1.0).finished();
    P = F * P * F.transpose();
    P(1, 1) += kStep * kWalk;
    lasting.carry(kYaw, kStep, {P(1, 1), 4.0 * P(1, 1), 9.0 * P(1, 1)});
    if (i % 10 != 9) continue;
    const double kept = kMeasured / (P(1, 1) + kMeasured);  // of the velocity's error: the place is not estimated
    P.row(1) *= kept;
    P(0, 1) = P(1, 0);
    lasting.carry(kYaw, 0.0, {P(1, 1), 4.0 * P(1, 1), 9.0 * P(1, 1)});
  }
  CHECK(told.x() == Approx(P(0, 0)).epsilon(1e-9));
  CHECK(told.y() == Approx(4.0 * P(0, 0)).epsilon(1e-9));
  CHECK(told.z() == Approx(9.0 * P(0, 0)).epsilon(1e-9));  // a yaw by its rate
  CHECK(steps < 0.2 * P(0, 0));                            // teeth
}

TEST_CASE("a velocity's error lasts in the vehicle's axes when it turns") {
  LastingVelocity lasting;
  lasting.carry(0.0, 0.0, {0.04, 0.0, 0.01});
  lasting.carry(0.0, 1.0, {0.04, 0.0, 0.01});
  CHECK(lasting.grown(0.0, 1.0).x() == Approx(0.12));  // (2 s)^2 - (1 s)^2
  CHECK(lasting.grown(M_PI_2, 1.0).x() == Approx(0.04));
  CHECK(lasting.grown(M_PI, 1.0).x() == Approx(-0.04));  // comes back
  CHECK(lasting.grown(M_PI, 1.0).z() == Approx(0.03));   // a yaw does not
}

TEST_CASE("what a vision's whole way has in common is taken out of its covariance, and no more than is there") {
  const auto at = [](double way) {  // 1 cm2 and 1e-6 rad2 per metre of its own
    Odometry o;
    o.velocity = {10.0, 0.2, 0.0};
    Vector6d own;
    own << Eigen::Vector3d::Constant(1e-4 * way), Eigen::Vector3d::Constant(1e-6 * way);
    o.cov_pose = own.asDiagonal();
    o.cov_velocity = 0.01 * Eigen::Matrix3d::Identity();
    return o;
  };
  const auto common = [](double way) {
    CommonError e;
    e.columns.col(0) << 0.01 * way, 0.001 * way, 0.0, 0.0, 0.0, 0.0;
    e.columns.col(1) << 0.0, 0.003 * way, 0.0, 0.0, 0.0, 0.004;
    e.scale_std = 0.01;
    return e;
  };
  const auto published = [&](double way) {
    Odometry o = at(way);
    o.cov_pose += common(way).columns * common(way).columns.transpose();
    o.cov_velocity += 1e-4 * o.velocity * o.velocity.transpose();
    return o;
  };
  const Odometry back = without_common(published(500.0), common(500.0));
  CHECK(back.cov_pose.isApprox(at(500.0).cov_pose, 1e-9));
  CHECK(back.cov_velocity.isApprox(at(500.0).cov_velocity, 1e-9));
  // A step of a metre: its own part, and what it would be with the common part left in, 5 m long after 500.
  const Planar motion(1.0, 0.0, 0.0);
  const auto step = [&](auto&& of) {
    return motion_covariance(Planar::Zero(), level_view(of(500.0)).P, motion, level_view(of(501.0)).P,
                             Eigen::Vector3d::Constant(1e-5))(0, 0);
  };
  CHECK(step([&](double way) { return without_common(published(way), common(way)); }) == Approx(1e-4).epsilon(0.02));
  CHECK(step(published) > 0.05);  // teeth
  // A status was lost: what is told is not in there.
  const Odometry kept = without_common(at(500.0), common(500.0));
  CHECK(Eigen::SelfAdjointEigenSolver<Matrix6d>(kept.cov_pose).eigenvalues().minCoeff() > -1e-12);
}

TEST_CASE("what a picture has wrong alone is taken out of its covariance, and told in the vehicle's axes") {
  PassingError passing;
  Vector6d own;
  own << 0.04, 0.01, 0.01, 1e-6, 1e-6, 4e-6;
  passing.picture = own.asDiagonal();
  passing.map = 2.0 * passing.picture;
  passing.map_time = 1.5;
  Odometry o;
  o.T_frame_vehicle.q = quaternion({M_PI_2, 0.0, 0.0});
  o.cov_pose = Matrix6d::Identity() + passing.picture;
  CHECK((without_picture(o, passing).cov_pose - Matrix6d::Identity()).norm() < 1e-9);
  o.cov_pose = 0.5 * passing.picture;  // a status was lost
  CHECK(Eigen::SelfAdjointEigenSolver<Matrix6d>(without_picture(o, passing).cov_pose).eigenvalues().minCoeff() >
        -1e-12);
  const PlanarPassing planar = planar_passing(o, passing);  // the car looks along the frame's y
  CHECK((planar.picture - Eigen::Vector3d(0.01, 0.04, 4e-6).asDiagonal().toDenseMatrix()).norm() < 1e-12);
  CHECK((planar.map - 2.0 * planar.picture).norm() < 1e-12);
  CHECK(planar.map_time == 1.5);
}

TEST_CASE("a picture's error that is singular, or not quite a covariance, is taken out as far as it is one") {
  Vector6d along;
  along << 0.2, 0.4, 0.1, 1e-3, 0.0, 2e-3;  // it errs in one direction alone
  const Matrix6d flat = along * along.transpose();
  const auto left = [](const Matrix6d& cov, const Matrix6d& picture) {
    PassingError passing;
    passing.picture = picture;
    Odometry o;
    o.cov_pose = cov;
    return without_picture(o, passing).cov_pose;
  };
  const Matrix6d one = Matrix6d::Identity();
  CHECK((left(one + flat, flat) - one).norm() < 1e-9);
  // Rounding, or a sum of losses: an eigenvalue below zero. Only what is an error goes.
  const Vector6d aside = Vector6d::Unit(4);
  CHECK((left(one + flat, flat - 1e-3 * aside * aside.transpose()) - one).norm() < 1e-9);
  CHECK(left(one, Matrix6d::Constant(std::numeric_limits<double>::quiet_NaN())) == one);
  // Teeth: Cholesky's factor, as far as it came, is no root of it.
  const Matrix6d unfinished = flat.llt().matrixL();
  CHECK((unfinished * unfinished.transpose() - flat).norm() > 1e-3);
  // A pose that is exact in one direction cannot hold an error there: nothing is taken out.
  Matrix6d exact = one;
  exact(1, 1) = 0.0;
  CHECK(left(exact, flat) == exact);
}

TEST_CASE("an error as a channel's vehicle has it, in the state's axes and lengths") {
  Draws draws(9);
  const FusionEstimate e = random_estimate(draws);
  const Eigen::Matrix3d A = draws.vector<9>(1.0).reshaped(3, 3), R = A * A.transpose();
  for (const ChannelSlots slots : {ChannelSlots{kVoClone, kVoScale, kVoTurns, {}, {}}, ChannelSlots{}}) {
    // A pose of the channel that is moved by d in its vehicle's axes moves the state's by this.
    Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
    J.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(e.x(kYaw)).toRotationMatrix();
    if (slots.scale) J.leftCols<2>() *= std::exp(-e.x(*slots.scale));
    CHECK(in_frame(R, e.x, slots).isApprox(J * R * J.transpose(), 1e-9));
  }
}

TEST_CASE("errors that last from picture to picture count as often as they are the same") {
  constexpr double kStep = 0.1, kTime = 1.2;
  constexpr int kPictures = 400, kRuns = 400;
  const auto source = std::make_unique<test::Draws>(5);
  const double keeps = std::exp(-2.0 * kStep / kTime);
  double squares = 0.0;  // of the mean of many pictures
  for (int run = 0; run < kRuns; ++run) {
    double e = source->normal(1.0), sum = 0.0;
    for (int i = 0; i < kPictures; ++i) {
      sum += e + source->normal(0.5);
      e = keeps * e + source->normal(std::sqrt(1.0 - keeps * keeps));
    }
    squares += sum * sum / kPictures / kRuns;
  }
  const PlanarPassing told{0.25 * Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity(), kTime};
  CHECK(squares == Approx(as_white(told, kStep)(1, 1)).epsilon(0.2));
  CHECK(squares > 5.0 * (told.picture + told.map)(1, 1));  // teeth: as if each were new
  CHECK(as_white(told, 100.0).isApprox(told.picture + told.map, 1e-9));
  CHECK(as_white({told.picture, told.map, 0.0}, kStep).isApprox(told.picture + told.map, 1e-9));
}

TEST_CASE("velocities tell the motion without the jump") {
  Odometry a, b;
  b.t_us = 100'000;
  a.velocity = b.velocity = Eigen::Vector3d(10.0, 0.0, 0.0);
  a.angular_rate.z() = b.angular_rate.z() = 0.2;
  a.T_frame_vehicle.q = quaternion({0.3, 0.0, 0.0});
  b.T_frame_vehicle.p = Eigen::Vector3d(7.0, 7.0, 0.0);  // wherever a fix took it
  b.T_frame_vehicle.q = quaternion({1.0, 0.0, 0.0});
  const Planar m = motion_by_velocity(level_view(a), level_view(b)).way;
  CHECK(m.x() == Approx(1.0).epsilon(1e-3));
  CHECK(m.y() == Approx(0.01).epsilon(1e-2));
  CHECK(m.z() == Approx(0.02));
}

TEST_CASE("rates that are means over an interval add up to the turn, a corrected attitude does not get in") {
  Odometry last;
  double summed = 0.0, yaw = 0.0;
  for (int i = 1; i <= 100; ++i) {  // into a turn; each rate is the mean over the 10 ms before
    Odometry now = last;
    now.t_us = 10'000 * i;
    now.angular_rate.z() = 0.004 * i;
    yaw += 0.01 * now.angular_rate.z();
    const double corrected = i > 50 ? 0.05 : 0.0;
    now.T_frame_vehicle.q = quaternion({yaw + corrected, 0.0, 0.0});
    summed += motion_by_velocity(level_view(last), level_view(now)).way.z();
    last = now;
  }
  CHECK(summed == Approx(yaw).margin(5e-5));  // the trapezium alone is off by 2e-3
}

}  // namespace
}  // namespace roadfix
