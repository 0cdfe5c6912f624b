#include "navigation/aiding/gnss_velocity/gnss_velocity_control.h"

#include "navigation/aiding/gnss_velocity/gnss_velocity_model.h"

namespace roadfix::navigation {

namespace {

constexpr double kLastingShare = 0.5;  // of the claimed variance, in the Gauss-Markov state
constexpr double kSmoothing = 0.1;     // s, of a receiver's low-pass filter: its error grows with the acceleration
constexpr double kErrorTime = 2.0;     // s
constexpr int kPersistent = 8;         // rejected in a row: more than a cluster of bad ones

}  // namespace

AidingRecord GnssVelocityControl::fuse(Filter& filter, const Queued& velocity, double gate) const {
  const double share = lasting_ ? kLastingShare : 0.0, factor = scale_.variance_factor();
  const Eigen::Vector3d lag = kSmoothing * filter.motion().acceleration;
  Measurement<3> m = gnss_velocity(filter.state(), filter.motion(), velocity.value,
                                   factor * (1.0 - share) * velocity.cov, velocity.ahead(filter.state().x));
  // A smoothed velocity looks like an antenna elsewhere: the antenna's place is noise here, and not estimated.
  const Eigen::Matrix3d by_antenna = m.H.middleCols<3>(kAntenna);
  m.R += by_antenna * filter.state().P().block<3, 3>(kAntenna, kAntenna) * by_antenna.transpose();
  m.H.middleCols<3>(kAntenna).setZero();
  const AidingRecord r = filter.fuse(AidingSource::kGnssVelocity, velocity.t_us, m, gate);
  if (r.status != AidingStatus::kAccepted || !lasting_) return r;
  filter.gnss_bias().velocity_time = kErrorTime;
  filter.gnss_bias().velocity_std = (factor * (share * velocity.cov.diagonal() + lag.cwiseAbs2())).cwiseSqrt();
  return r;
}

AidingRecord GnssVelocityControl::use(Filter& filter, const Queued& velocity) {
  const AidingRecord r = fuse(filter, velocity, gates_.nis[3]);
  rejected_ = r.status == AidingStatus::kGated ? rejected_ + 1 : 0;
  if (r.status == AidingStatus::kAccepted || rejected_ >= kPersistent) scale_.learn(r);
  return r;
}

AidingRecord GnssVelocityControl::try_on(Filter& filter, const Queued& velocity) const {
  return fuse(filter, velocity, Gates::open().nis[3]);
}

}  // namespace roadfix::navigation
