#include "fusion/channel_calibration.h"

#include <cmath>

namespace roadfix {
namespace {

constexpr double kNoLengths = 1e3;  ///< m, sigma of a length that is not measured

}  // namespace

void MotionStep::add(const MotionStep& step) {
  const MovedPlanar moved = moved_by(motion, step.motion);
  motion = moved.pose;
  Q = moved_covariance(moved, Q, step.Q);
  by_calibration = moved.by_start * by_calibration + moved.by_motion * step.by_calibration;
  rise += step.rise;
  dt += step.dt;
}

Eigen::Matrix3d MotionStep::covariance(const CalibrationMatrix& P) const {
  return Q + by_calibration * P * by_calibration.transpose();
}

ChannelCalibration::ChannelCalibration(const CalibrationNoise& noise) : noise_(noise), P_(CalibrationMatrix::Zero()) {
  P_.diagonal() << noise.scale, noise.heading, noise.turns, noise.drift, noise.arm;
  P_ = P_.cwiseAbs2().eval();
}

double ChannelCalibration::length() const { return std::exp(-x_(kScale)); }

MotionStep ChannelCalibration::corrected(const Planar& measured, double dt) const {
  const double turn = std::exp(-x_(kTurns)) * (measured.z() - x_(kDrift) * dt);
  // The path bends by half of what the turn is corrected by.
  const double bend = -x_(kHeading) + 0.5 * (turn - measured.z());
  const Eigen::Vector2d aside = turn * Eigen::Vector2d(-std::sin(0.5 * turn), std::cos(0.5 * turn));
  const Eigen::Vector2d way = length() * (Eigen::Rotation2Dd(bend) * measured.head<2>()) + x_(kArm) * aside;
  MotionStep step;
  step.motion << way.x(), way.y(), turn;
  step.dt = dt;
  const Eigen::Vector2d left(-way.y(), way.x());
  const double by_drift = -std::exp(-x_(kTurns)) * dt;
  step.by_calibration.block<2, 1>(0, kScale) = -way;
  step.by_calibration.block<2, 1>(0, kHeading) = -left;
  step.by_calibration.block<2, 1>(0, kTurns) = -0.5 * turn * left;
  step.by_calibration.block<2, 1>(0, kDrift) = 0.5 * by_drift * left;
  step.by_calibration.block<2, 1>(0, kArm) = aside;
  step.by_calibration(2, kTurns) = -turn;
  step.by_calibration(2, kDrift) = by_drift;
  return step;
}

void ChannelCalibration::learn(const MotionStep& sum, const Planar& reference, const Eigen::Matrix3d& R) {
  const MotionByCalibration& H = sum.by_calibration;
  const Eigen::Matrix<double, kCalibration, 3> PHt = P_ * H.transpose();
  const Eigen::Matrix3d S = H * PHt + sum.Q + R;
  const Eigen::LLT<Eigen::Matrix3d> llt(S);
  if (llt.info() != Eigen::Success) return;
  x_ += PHt * llt.solve(difference_of(reference, sum.motion));
  P_ -= PHt * llt.solve(PHt.transpose());
  P_ = (0.5 * (P_ + P_.transpose())).eval();
}

void ChannelCalibration::learn_turns(MotionStep sum, const Planar& reference, Eigen::Matrix3d R) {
  sum.by_calibration.col(kScale).setZero();
  R(0, 0) += kNoLengths * kNoLengths;
  learn(sum, reference, R);
}

void ChannelCalibration::forget_scale() {
  P_.row(kScale).setZero();
  P_.col(kScale).setZero();
  P_(kScale, kScale) = noise_.scale * noise_.scale;
}

void ChannelCalibration::set_scale(double log_scale, double sigma) {
  forget_scale();
  x_(kScale) = log_scale;
  P_(kScale, kScale) = sigma * sigma;
}

void ChannelCalibration::age(double dt) {
  P_(kScale, kScale) += noise_.scale_walk * noise_.scale_walk * dt;
  P_(kHeading, kHeading) += noise_.heading_walk * noise_.heading_walk * dt;
  P_(kDrift, kDrift) += noise_.drift_walk * noise_.drift_walk * dt;
}

}  // namespace roadfix
