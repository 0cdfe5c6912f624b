#include "navigation/initialisation/heading_hypotheses.h"

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "navigation/aiding/gates.h"
#include "navigation/aiding/gnss_error_states.h"
#include "navigation/aiding/gnss_position/gnss_position_model.h"
#include "navigation/aiding/heading_rows.h"
#include "navigation/aiding/zero_motion/zero_motion_model.h"
#include "navigation/motion/road_level.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

// A record counts at most this much against a hypothesis: one outlier must not decide.
constexpr double kMostNis = 50.0;
// Above this speed hardly a car is in reverse. With the constraint a heading and its opposite look alike until the car
// turns or brakes hard.
constexpr double kReverseLogProbability = -12.0;  // log of 6e-6
// A car that seems to stand as it was parked: how often it was turned all the same, and by how much it may be off.
constexpr double kTurned = 1e-4;
constexpr double kParkedYaw = 0.3 * kDegree;
constexpr double kNegligible = 1e-9;  // share of a hypothesis that is dropped
constexpr double kSameHeading = 15.0 * kDegree;
constexpr double kStartPosition = 1000.0, kStartVelocity = 100.0, kStartTilt = 0.5;  // m, m/s, rad: nothing is known
constexpr double kLocalPlace = 1e-4;  // m: where a local frame begins is a convention

double square(double x) { return x * x; }

}  // namespace

BaseVector start_sigmas(const NavigationConfig& c, const StartState& s, double yaw_std) {
  const VehicleFacts& v = c.facts;
  BaseVector std = BaseVector::Zero();
  std.segment<3>(kAtt) << kStartTilt, kStartTilt, yaw_std;
  std.segment<3>(kVel).setConstant(kStartVelocity);
  std.segment<3>(kPos).setConstant(s.local ? kLocalPlace : kStartPosition);
  std.segment<3>(kGyroBias) = v.gyro_bias_std * v.measured_rates();
  std.segment<3>(kAccelBias).setConstant(v.accel_bias_std);
  std.segment<6>(kGyroScale).setConstant(v.scale_std);
  std(kWheelScale) = v.wheel_scale_std;
  std.segment<2>(kMounting) = v.mounting_std.tail<2>();
  if (v.mounting_known()) std(kRearSlip) = vehicle::kRearSlipStd;
  std.segment<3>(kAxle) = v.p_imu_axle_std;
  std.segment<3>(kAntenna) = v.p_imu_antenna_std;
  const ClockPriors time(v);
  std(kPositionLatency) = time.position_latency;
  std(kVelocityLatency) = time.velocity_latency;
  std(kImuOffset) = time.imu_offset;
  std(kWheelLatency) = time.wheel_latency;
  std.segment<3>(kGnssBias) = s.bias_std;
  return std;
}

double vehicle_yaw(const Mean& x) {
  const Eigen::Vector3d forward = x.nav.q_level_imu * (vehicle::R_imu_vehicle(x.mounting) * Eigen::Vector3d::UnitX());
  return std::atan2(forward.y(), forward.x());
}

double vehicle_heading_std(const State& state) {
  const Measurement<1> m = bearing(state, Eigen::Vector3d::UnitX(), 0.0, 0.0);
  return std::sqrt((m.H * state.P().topLeftCorner<kWithoutCamera, kWithoutCamera>() * m.H.transpose())(0, 0));
}

void HeadingHypotheses::start(const inertial::Earth& earth, const StartState& s) {
  filters_.clear();
  log_weights_.clear();
  leader_ = 0;
  const int n = config_.start.headings;
  if (s.yaw) {
    add_hypothesis(earth, s, *s.yaw, s.yaw_std, 0.0);
    return;
  }
  // The first points along the motion where there is one; the order decides nothing else.
  const double first = s.velocity.head<2>().norm() > 1.0 ? std::atan2(s.velocity.y(), s.velocity.x()) : 0.0;
  for (int i = 0; i < n; ++i)
    add_hypothesis(earth, s, wrap_angle(first + 2.0 * kPi * i / n), config_.start.heading_std,
                   s.parked_yaw ? std::log(kTurned / n) : 0.0);
  // What it stood on may have been turned: on a ferry, by a tow to the next bay.
  if (s.parked_yaw) add_hypothesis(earth, s, *s.parked_yaw, std::hypot(s.memory->heading_sigma, kParkedYaw), 0.0);
  normalise();
}

void HeadingHypotheses::start(const Filter& unsure) {
  filters_.clear();
  log_weights_.clear();
  leader_ = 0;
  Filter known = unsure;
  known.flush();
  known.state().release();
  Filter filter(config_, known.earth(), false);
  filter.adopt_without_camera(known);
  filter.consider({kPositionLatency, 4});
  const int64_t now_us = filter.state().x.t_us;
  (void)filter.fuse(AidingSource::kNonholonomic, now_us, road_level(filter.state(), config_.car.tilt_std),
                    Gates::open().nis[2]);
  const double spread = square(vehicle_heading_std(filter.state())), own = square(config_.start.heading_std);
  const double between = std::max(spread - own, 0.0);
  const int n = between > 0.0 ? config_.start.headings : 1;
  for (int i = 0; i < n; ++i) {
    const double off = wrap_angle(2.0 * kPi * i / n);
    const double log_weight = i == 0 ? 0.0 : -0.5 * off * off / between;
    if (log_weight < std::log(kNegligible)) continue;
    filters_.push_back(filter);
    log_weights_.push_back(log_weight);
    if (n == 1) continue;
    Measurement<1> m = bearing(filter.state(), Eigen::Vector3d::UnitX(), 0.0, std::sqrt(spread * own / between));
    m.residual(0) = off * spread / between;
    (void)filters_.back().fuse(AidingSource::kGnssHeading, now_us, m, Gates::open().nis[1]);
  }
}

void HeadingHypotheses::add_hypothesis(const inertial::Earth& earth, const StartState& s, double yaw, double yaw_std,
                                       double log_weight) {
  Mean x;
  x.t_us = s.t_us;
  x.nav.q_level_imu = level_attitude(s.mean_accel, yaw);
  x.nav.velocity = s.velocity;
  x.mounting = config_.facts.mounting;
  x.rear_slip = vehicle::kRearSlip;
  x.p_imu_axle = config_.facts.p_imu_axle;
  x.p_imu_antenna = config_.facts.p_imu_antenna;
  if (!s.local) x.nav.position = s.antenna - x.nav.q_level_imu * x.p_imu_antenna;
  BaseVector sigmas = start_sigmas(config_, s, yaw_std);
  // Wheels or pictures say that it stands: what the gyro reads is bias, but for the Earth's rate.
  if (s.local && s.standing) {
    x.gyro_bias = s.mean_gyro;
    sigmas.segment<3>(kGyroBias).setConstant(s.gyro_std);
  }
  if (s.memory) recall(*s.memory, x, sigmas);
  filters_.emplace_back(config_, earth, false);
  log_weights_.push_back(log_weight);
  Filter& filter = filters_.back();
  // Delays show through velocity and acceleration, whose direction is not known yet.
  filter.consider({kPositionLatency, 4});
  filter.initialise(x, sigmas);
  if (s.return_std.x() > 0.0) begin_gnss_return(filter, s.return_std);
  // Using what the mean came from as measurements gives every correlation: tilt with accelerometer bias, position with
  // attitude through the lever arm, velocity in level axes with the heading.
  const double open = Gates::open().nis[3];
  if (config_.facts.has_imu) {
    const Eigen::Vector3d gravity = filter.earth().gravity(x.nav.position);
    (void)filter.fuse(AidingSource::kZeroVelocity, s.t_us,
                      levelling(filter.state(), s.mean_accel, gravity, s.accel_std), open);
  } else {
    (void)filter.fuse(AidingSource::kZeroVelocity, s.t_us, road_level(filter.state(), config_.car.tilt_std), open);
  }
  Measurement<3> velocity;
  velocity.residual = s.velocity - filter.state().x.nav.velocity;
  velocity.H.block<3, 3>(0, kVel).setIdentity();
  // Wheels measure it in vehicle axes: free of phi, as it turns with the attitude.
  if (!s.local) velocity.H.block<3, 3>(0, kAtt) = -skew(filter.state().x.nav.velocity);
  velocity.R = s.velocity_std * s.velocity_std * Eigen::Matrix3d::Identity();
  (void)filter.fuse(AidingSource::kGnssVelocity, s.t_us, velocity, open);
  if (!s.local)
    (void)filter.fuse(AidingSource::kGnssPosition, s.t_us,
                      gnss_position(filter.state(), BodyMotion(), s.antenna, s.antenna_cov, 0.0), open);
  if (s.standing && !s.local)
    (void)filter.fuse(AidingSource::kZeroRate, s.t_us,
                      zero_rate(filter.state(), s.mean_gyro, filter.earth().rate(), config_.aiding.zero_rate_std),
                      open);
}

void HeadingHypotheses::predict(const ImuSample& imu, double dt, const inertial::ImuNoise& noise) {
  for (Filter& filter : filters_) filter.predict(imu, dt, noise);
}

void HeadingHypotheses::weigh(size_t i, const AidingRecord& r) {
  if (r.status != AidingStatus::kAccepted && r.status != AidingStatus::kGated) return;
  log_weights_[i] += std::max(r.log_likelihood, r.log_likelihood + 0.5 * (r.nis - kMostNis));
}

double HeadingHypotheses::log_posterior(size_t i) const {
  const Mean& x = filters_[i].state().x;
  const Eigen::Vector3d forward = vehicle::R_imu_vehicle(x.mounting) * Eigen::Vector3d::UnitX();
  const double speed = (x.nav.q_level_imu * forward).dot(x.nav.velocity);
  return log_weights_[i] + (speed < -vehicle::kReverseSpeed ? kReverseLogProbability : 0.0);
}

void HeadingHypotheses::normalise() {
  const double most = *std::max_element(log_weights_.begin(), log_weights_.end());
  for (double& w : log_weights_) w -= most;
  leader_ = 0;
  for (size_t i = 1; i < filters_.size(); ++i)
    if (log_posterior(i) > log_posterior(leader_)) leader_ = i;
  for (size_t i = filters_.size(); i-- > 0;) {
    if (i == leader_ || share(i) > kNegligible || log_weights_[i] > std::log(kNegligible)) continue;
    filters_.erase(filters_.begin() + static_cast<std::ptrdiff_t>(i));
    log_weights_.erase(log_weights_.begin() + static_cast<std::ptrdiff_t>(i));
    if (leader_ > i) --leader_;
  }
}

double HeadingHypotheses::share(size_t i) const { return std::exp(log_posterior(i) - log_posterior(leader_)); }

double HeadingHypotheses::heading_std() const {
  const double yaw = vehicle_yaw(leader().state().x);
  double total = 0.0, squares = 0.0;
  for (size_t i = 0; i < filters_.size(); ++i) {
    const double off = wrap_angle(vehicle_yaw(filters_[i].state().x) - yaw);
    const double own = vehicle_heading_std(filters_[i].state());
    total += share(i);
    squares += share(i) * (off * off + own * own);
  }
  return std::sqrt(squares / total);
}

void HeadingHypotheses::merge_into(Filter& filter) const {
  filter = leader();
  filter.flush();
  using Square = Eigen::Matrix<double, kWithoutCamera, kWithoutCamera>;
  Square sum = Square::Zero();
  double total = 0.0;
  const State& lead = filter.state();
  for (size_t i = 0; i < filters_.size(); ++i) {
    Filter other = filters_[i];
    other.flush();
    const Eigen::Matrix<double, kWithoutCamera, 1> off =
        local(lead.x, other.state().x, lead.p_ref).head<kWithoutCamera>();
    sum += share(i) * (other.state().P().topLeftCorner<kWithoutCamera, kWithoutCamera>() + off * off.transpose());
    total += share(i);
  }
  filter.state().P().topLeftCorner<kWithoutCamera, kWithoutCamera>() = sum / total;
}

bool HeadingHypotheses::confirmed() const {
  if (filters_.empty()) return false;
  if (vehicle_heading_std(leader().state()) > config_.start.confirm_std) return false;
  const double yaw = vehicle_yaw(leader().state().x);
  double others = 0.0, same = 0.0;
  for (size_t i = 0; i < filters_.size(); ++i) {
    const bool agrees = std::abs(wrap_angle(vehicle_yaw(filters_[i].state().x) - yaw)) < kSameHeading;
    (agrees ? same : others) += share(i);
  }
  return same / (same + others) > config_.start.confirm_probability;
}

}  // namespace roadfix::navigation
