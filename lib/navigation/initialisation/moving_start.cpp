#include "navigation/initialisation/moving_start.h"

#include <cmath>

#include "navigation/aiding/nonholonomic/nonholonomic_control.h"
#include "navigation/initialisation/heading_hypotheses.h"
#include "vehicle/axle_velocity.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr double kLongest = 4.0;   // s gone through
constexpr double kShortest = 1.0;  // s, likewise
constexpr double kEvery = 1.0;     // s between two attempts
constexpr double kLevel = 0.5;     // s from the beginning, whose mean specific force is taken for gravity
// m/s along the vehicle: a guess that is too low approaches the truth from below, one too high overshoots beyond zero.
constexpr double kGuess = 6.0, kGuessStd = 15.0;
constexpr double kLeastTilt = 0.1;                    // rad, of a road and a lean
constexpr double kKnownShare = 0.1, kKnownStd = 1.0;  // of the speed; m/s: of the speed at the end, at most
constexpr double kHopeless = 0.5;                     // likewise: nothing has told it
constexpr int kSurePass = 3;

struct Speed {
  double value = 0.0, std = 0.0;  // m/s
};

Speed speed_of(const State& state) {
  // In v = Exp(phi) v^ + nu phi does not change the speed.
  const Eigen::Vector3d& v = state.x.nav.velocity;
  const Eigen::Vector3d along = v.normalized();
  return {v.norm(), std::sqrt(along.dot(state.P().block<3, 3>(kVel, kVel) * along))};
}

Mean mean_at(const Mean& sensors, const Eigen::Quaterniond& q, const Eigen::Vector3d& velocity, int64_t t_us) {
  Mean x = sensors;
  x.t_us = t_us;
  x.nav.q_level_imu = q;
  x.nav.velocity = q * velocity;
  x.nav.position.setZero();
  return x;
}

}  // namespace

void MovingStart::add(const ImuSample& imu, double max_gap) {
  if (!imu_.empty() && seconds_between(imu_.back().t_us, imu.t_us) > max_gap) imu_.clear();
  imu_.push_back(imu);
  while (seconds_between(imu_.front().t_us, imu.t_us) > kLongest || static_cast<int64_t>(imu_.size()) > kMostSamples)
    imu_.pop_front();
}

void MovingStart::clear() {
  imu_.clear();
  tried_us_ = 0;
}

MovingStart::Beginning MovingStart::guess(const NavigationConfig& config) const {
  Beginning b;
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  for (const ImuSample& s : imu_)
    if (seconds_between(imu_.front().t_us, s.t_us) < kLevel) force += s.accel;
  b.up = force.normalized();
  const VehicleFacts& facts = config.facts;
  if (facts.mounting_known()) b.velocity = kGuess * (vehicle::R_imu_vehicle(facts.mounting) * Eigen::Vector3d::UnitX());
  b.sensors.mounting = facts.mounting;
  b.sensors.rear_slip = vehicle::kRearSlip;
  b.sensors.p_imu_axle = facts.p_imu_axle;
  b.sensors.p_imu_antenna = facts.p_imu_antenna;
  b.sensors.T_imu_camera = facts.camera->T_imu_camera;
  b.sensors.T_left_right = facts.camera->T_left_right;
  b.sensors.camera_offset = facts.camera->offset;
  return b;
}

MovingStart::Started MovingStart::go_through(const NavigationConfig& config, const Beginning& prior,
                                             const Beginning& at, bool found, const CameraControl& camera,
                                             const inertial::ImuNoise& noise) const {
  const int64_t begin_us = imu_.front().t_us;
  const Eigen::Quaterniond q = level_attitude(at.up, 0.0);
  const Eigen::Quaterniond upright = Eigen::Quaterniond::FromTwoVectors(q * prior.up, Eigen::Vector3d::UnitZ());
  const Mean course = mean_at(at.sensors, q, at.velocity, begin_us);
  const Mean known = mean_at(prior.sensors, upright * q, prior.velocity, begin_us);

  StartState start;
  start.local = true;
  BaseVector sigmas = start_sigmas(config, start, 1e-4);
  sigmas.segment<2>(kAtt).setConstant(
      std::hypot(kLeastTilt, vehicle::kEverydayAccel / inertial::Earth().gravity(known.nav.position).norm()));
  Filter blind(config, inertial::Earth(), false);
  blind.initialise(course, sigmas);
  Started run{Filter(config, inertial::Earth(), true), camera};
  run.filter.adopt(blind, *config.facts.camera);
  State& state = run.filter.state();
  state.x = course;
  // The velocity is known in vehicle axes, whatever the attitude is: nu = R du, free of phi.
  Eigen::Vector3d spread = Eigen::Vector3d::Constant(kGuessStd);
  if (const VehicleFacts& facts = config.facts; facts.mounting_known())
    spread.tail<2>().setConstant(vehicle::kAside +
                                 (vehicle::kAsideShare + facts.mounting_std.tail<2>().maxCoeff()) * kGuessStd);
  const Eigen::Matrix3d R = q.toRotationMatrix() * vehicle::R_imu_vehicle(config.facts.mounting);
  const Eigen::Matrix3d cov = R * spread.cwiseAbs2().asDiagonal() * R.transpose();
  state.P().block<3, 3>(kVel, kVel) = 0.5 * (cov + cov.transpose());
  std::optional<Filter> found_course;
  if (found) {
    found_course.emplace(run.filter);
    found_course->state().P().setZero();
  }
  state.hold(local(course, known, state.p_ref));

  run.camera.begin_smoothing();
  run.camera.skip_before(begin_us, course);
  NonholonomicControl constraint(config);
  for (size_t i = 1; i < imu_.size(); ++i) {
    const double dt = seconds_between(imu_[i - 1].t_us, imu_[i].t_us);
    run.filter.predict(imu_[i], dt, noise);
    if (found) found_course->predict(imu_[i], dt, noise);
    for (const int axis : {1, 2})
      if (constraint.due(axis, imu_[i].t_us)) (void)constraint.use(run.filter, axis, false);
    while (run.camera.next_us(state.x).value_or(INT64_MAX) <= imu_[i].t_us)
      (void)run.camera.use(run.filter, false, found ? &*found_course : nullptr);
  }
  run.filter.flush();
  run.camera.end_smoothing();
  state.release();
  return run;
}

/// The turn since then, then what the imu says was gained, by what is known now.
MovingStart::Beginning MovingStart::beginning_of(const Mean& end) const {
  const auto carried = [&](const Eigen::Quaterniond& q) {
    Mean x = mean_at(end, q, Eigen::Vector3d::Zero(), imu_.front().t_us);
    Propagation propagation{inertial::Earth()};
    for (size_t i = 1; i < imu_.size(); ++i)
      propagation.move(x, imu_[i], seconds_between(imu_[i - 1].t_us, imu_[i].t_us));
    return x.nav;
  };
  const Eigen::Quaterniond q = end.nav.q_level_imu * carried(Eigen::Quaterniond::Identity()).q_level_imu.conjugate();
  Beginning b;
  b.up = q.conjugate() * Eigen::Vector3d::UnitZ();
  b.velocity = q.conjugate() * (end.nav.velocity - carried(q).velocity);
  b.sensors = end;
  return b;
}

std::optional<MovingStart::Started> MovingStart::attempt(const NavigationConfig& config, const CameraControl& camera,
                                                         const inertial::ImuNoise& noise) {
  if (imu_.empty() || seconds_between(imu_.front().t_us, imu_.back().t_us) < kShortest) return std::nullopt;
  if (tried_us_ != 0 && seconds_between(tried_us_, imu_.back().t_us) < kEvery) return std::nullopt;
  tried_us_ = imu_.back().t_us;
  const Beginning prior = guess(config);
  Beginning at = prior;
  double before = at.velocity.norm();
  for (int pass = 1; pass <= Iteration::kMostPasses; ++pass) {
    Started run = go_through(config, prior, at, pass > 1, camera, noise);
    const Speed end = speed_of(run.filter.state());
    const Eigen::Vector3d up_before = at.up;
    at = beginning_of(run.filter.state().x);
    const double tilted = at.up.cross(up_before).norm();
    const double tilt_std = std::sqrt(run.filter.state().P().diagonal().segment<2>(kAtt).maxCoeff());
    const double ahead =
        prior.velocity.norm() > 0.0 ? at.velocity.dot(prior.velocity.normalized()) : at.velocity.norm();
    if (!(ahead > vehicle::kLeastSpeed)) return std::nullopt;
    if (pass > kSurePass && end.std > kHopeless * end.value) return std::nullopt;
    if (pass >= kSurePass && std::abs(ahead - before) < Iteration::kSettled * end.std &&
        tilted < Iteration::kSettled * tilt_std) {
      const bool known = end.std < std::min(kKnownStd, kKnownShare * end.value);
      return known && run.camera.fits() ? std::optional(std::move(run)) : std::nullopt;
    }
    before = ahead;
  }
  return std::nullopt;
}

}  // namespace roadfix::navigation
