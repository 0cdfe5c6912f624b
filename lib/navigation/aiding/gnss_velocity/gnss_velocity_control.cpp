#include "navigation/aiding/gnss_velocity/gnss_velocity_control.h"

#include "geometry/so3.h"
#include "navigation/aiding/gnss_error_states.h"
#include "navigation/aiding/gnss_velocity/gnss_velocity_model.h"

namespace roadfix::navigation {

namespace {

constexpr LastingError kWithoutImu = {0.5, 0.5};  // nothing propagates a velocity well enough to show it
constexpr double kSmoothing = 0.1;    // s, what is left of a receiver's low pass: its error grows with the acceleration
constexpr int kPersistent = 8;        // rejected in a row: more than a cluster of bad ones
constexpr double kTiltTime = 10.0;    // s, for which tilt and biases of an aided filter are off by the same
constexpr double kLeastDrift = 0.01;  // m/s/sqrt(s), of a velocity that the imu carries

/// (m/s2)^2, level, of what the imu says by tilt and accelerometer biases.
Eigen::Vector3d acceleration_variance(const Filter& filter) {
  const State& s = filter.state();
  const Eigen::Vector3d force =
      filter.motion().acceleration - inertial::Earth(filter.earth()).gravity(s.x.nav.position);
  Eigen::Matrix<double, 3, 6> H;  // of the acceleration by attitude and accelerometer bias
  H << -skew(force), -s.x.R();
  Eigen::Matrix<double, 6, 6> P;
  P << s.P().block<3, 3>(kAtt, kAtt), s.P().block<3, 3>(kAtt, kAccelBias), s.P().block<3, 3>(kAccelBias, kAtt),
      s.P().block<3, 3>(kAccelBias, kAccelBias);
  return (H * P * H.transpose()).diagonal();
}

/// m2/s3, level: by how much the propagated velocity may drift, as a random walk.
Eigen::Vector2d drift_rate(const Filter& filter) {
  return (2.0 * kTiltTime * acceleration_variance(filter).head<2>().array() + kLeastDrift * kLeastDrift).matrix();
}

}  // namespace

LastingError GnssVelocityControl::lasting() const {
  if (!lasting_) return {};
  return has_imu_ ? models_.mean() : kWithoutImu;
}

Measurement<3> GnssVelocityControl::measurement(const Filter& filter, const Queued& velocity, double white) const {
  const SmoothingTime::Expected smoothed =
      smoothing_.expected(filter.motion().lag, filter.motion().acceleration, acceleration_variance(filter));
  BodyMotion motion = filter.motion();
  motion.acceleration = smoothed.rate;
  motion.acceleration.z() = 0.0;  // the road's unevenness, over before a latency has passed
  return gnss_velocity(filter.state(), motion, velocity.value - smoothed.lag, white * velocity.cov + smoothed.spread,
                       velocity.ahead(filter.state().x));
}

Eigen::Vector2d GnssVelocityControl::off_way(const Filter& filter, const Queued& velocity) const {
  return (measurement(filter, velocity, 1.0).residual + filter.state().x.gnss_velocity_bias).head<2>();
}

AidingRecord GnssVelocityControl::fuse(Filter& filter, const Queued& velocity, double gate) const {
  const LastingError like = lasting();
  const double factor = scale_.variance_factor();
  const Eigen::Vector3d left = kSmoothing * filter.motion().acceleration;
  Measurement<3> m = measurement(filter, velocity, factor * (1.0 - like.share));
  m.considered = {kAntenna, 3};  // a smoothed velocity looks like an antenna elsewhere,
  m.shows_antenna = timed_;      // a late one no less
  const AidingRecord r = filter.fuse(AidingSource::kGnssVelocity, velocity.t_us, m, gate);
  if (r.status != AidingStatus::kAccepted || !lasting_) return r;
  filter.gnss_bias().velocity_time = 1.0 / like.rate;
  filter.gnss_bias().velocity_std = (factor * (like.share * velocity.cov.diagonal() + left.cwiseAbs2())).cwiseSqrt();
  return r;
}

AidingRecord GnssVelocityControl::use(Filter& filter, const Queued& velocity) {
  const Eigen::Vector2d before = off_way(filter, velocity);
  // Beyond the position's: a receiver's clock that steps is no low pass.
  const double latency = filter.state().x.velocity_latency - filter.state().x.position_latency;
  const Eigen::Vector3d acceleration = filter.motion().acceleration, variance = acceleration_variance(filter);
  const AidingRecord r = fuse(filter, velocity, gates_.nis[3]);
  rejected_ = r.status == AidingStatus::kGated ? rejected_ + 1 : 0;
  if (r.status == AidingStatus::kAccepted || rejected_ >= kPersistent) scale_.learn(r);
  if (r.status != AidingStatus::kAccepted) return r;
  if (lasting_ && has_imu_) watch(filter, velocity, before);
  filter.state().x.velocity_latency += smoothing_.learn(r, filter.motion().lag, acceleration, variance, latency);
  return r;
}

/// A used velocity shows what of the receiver's errors lasts, (N.5.4).
void GnssVelocityControl::watch(Filter& filter, const Queued& velocity, const Eigen::Vector2d& before) {
  if (seconds_between(last_us_, velocity.t_us) > kOutage) models_.begin_anew();
  last_us_ = velocity.t_us;
  const double share = models_.mean().share;
  models_.add(
      {velocity.t_us, before, off_way(filter, velocity), velocity.cov.diagonal().head<2>(), drift_rate(filter)});
  const double ratio = models_.mean().share / share;
  rescale_gnss_bias(filter, kGnssVelocityBias, ratio, ratio * filter.gnss_bias().velocity_std.cwiseAbs2());
}

AidingRecord GnssVelocityControl::try_on(Filter& filter, const Queued& velocity) const {
  return fuse(filter, velocity, Gates::open().nis[3]);
}

}  // namespace roadfix::navigation
