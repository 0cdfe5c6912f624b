#include "navigation/aiding/gnss_position/gnss_position_control.h"

#include <algorithm>
#include <cmath>

#include "navigation/aiding/gnss_position/gnss_position_model.h"

namespace roadfix::navigation {

namespace {

constexpr double kOutage = 3.0;  // s without a position, after which its errors are new

/// Share of a fix's variance that lasts, and for how long: a fixed carrier phase leaves multipath of centimetres, code
/// errors last seconds to a minute (Misra and Enge, Global Positioning System, 2006, ch. 5).
struct ErrorShape {
  double lasting_share;
  double time;  // s
};
ErrorShape shape_of(FixType type) {
  if (type == FixType::kRtkFixed) return {0.1, 30.0};
  return {0.8, 30.0};
}

// m: how far off a receiver may come back from an outage without a fixed phase, level and up; and how far a displaced
// one typically is.
constexpr double kReturnLevel = 3.0, kReturnUp = 6.0;
constexpr double kDisplacement = 5.0;
constexpr double kDisplacedPrior = 0.01;               // of a run of rejected fixes
constexpr double kTailFreedom = 3.0;                   // Student's t: errors of filters and receivers have heavy tails
constexpr int kRunForFilter = 2, kRunForReceiver = 3;  // rejected fixes that agree, to decide

/// Student's t in two dimensions, without its constant.
double log_tail(const Eigen::Vector2d& off, const Eigen::Matrix2d& cov) {
  const double m = off.dot(cov.inverse() * off);
  return -0.5 * std::log(cov.determinant()) - 0.5 * (kTailFreedom + 2.0) * std::log1p(m / kTailFreedom);
}

}  // namespace

Measurement<3> GnssPositionControl::measurement(const Filter& filter, const Queued& fix) const {
  const double white = (1.0 - shape_of(fix.fix_type).lasting_share) * scale(fix.fix_type);
  return gnss_position(filter.state(), filter.motion(), fix.value, white * fix.cov, fix.ahead(filter.state().x));
}

Eigen::Vector3d GnssPositionControl::lasting_std(const GnssFix& fix) const {
  return (shape_of(fix.fix_type).lasting_share * scale(fix.fix_type) * fix.cov_enu.diagonal()).cwiseSqrt();
}

void GnssPositionControl::begin(Filter& filter, const Queued& fix) const {
  const ErrorShape shape = shape_of(fix.fix_type);
  const Eigen::Vector3d std = (shape.lasting_share * scale(fix.fix_type) * fix.cov.diagonal()).cwiseSqrt();
  filter.gnss_bias().position_std = std;
  filter.gnss_bias().position_time = shape.time;
  const bool returns = tried_at_us_ != 0 && seconds_between(tried_at_us_, fix.t_us) > kOutage;
  if (tried_at_us_ != 0 && !returns && fix.fix_type == last_type_) return;
  const Eigen::Vector3d displaced = returns && fix.fix_type != FixType::kRtkFixed
                                        ? Eigen::Vector3d(kReturnLevel, kReturnLevel, kReturnUp)
                                        : Eigen::Vector3d::Zero();
  filter.reset_block(kGnssBias, Eigen::Vector3d::Zero(), (std.cwiseAbs2() + displaced.cwiseAbs2()).cwiseSqrt());
}

AidingRecord GnssPositionControl::try_on(Filter& filter, const Queued& fix) const {
  begin(filter, fix);
  return filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix), Gates::open().nis[3]);
}

AidingRecord GnssPositionControl::use(Filter& filter, const Queued& fix) {
  begin(filter, fix);
  tried_at_us_ = fix.t_us;
  last_type_ = fix.fix_type;
  AidingRecord r = filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix), gates_.nis[3]);
  if (r.status == AidingStatus::kGated) {
    const AidingRecord level = use_level(filter, fix);
    r = level.status == AidingStatus::kAccepted ? level : decide(filter, fix, r);
  } else if (r.status == AidingStatus::kAccepted) {
    scale_[static_cast<size_t>(fix.fix_type)].learn(r);
    height_differs_ = false;
  }
  if (r.status == AidingStatus::kAccepted || r.status == AidingStatus::kReset) {
    used_at_us_ = fix.t_us;
    rejected_ = 0;
  }
  return r;
}

/// The height alone contradicts: it becomes an error of the receiver's height, which fades as its errors do.
AidingRecord GnssPositionControl::use_level(Filter& filter, const Queued& fix) {
  const Measurement<3> all = measurement(filter, fix);
  Measurement<2> level;
  level.residual = all.residual.head<2>();
  level.H = all.H.topRows<2>();
  level.R = all.R.topLeftCorner<2, 2>();
  const AidingRecord r = filter.fuse(AidingSource::kGnssPosition, fix.t_us, level, gates_.nis[2]);
  if (r.status != AidingStatus::kAccepted) return r;
  height_differs_ = true;
  BaseVector wider = BaseVector::Zero();
  wider(kGnssBias + 2) = all.residual(2);
  filter.widen(wider);
  return r;
}

/// (N.5.5): displaced receiver or wrong filter?
AidingRecord GnssPositionControl::decide(Filter& filter, const Queued& fix, const AidingRecord& rejected) {
  AidingRecord r = rejected;
  const Measurement<3> m = measurement(filter, fix);
  const Eigen::Vector3d off = m.residual;
  // What b holds may be over: a displaced receiver comes back.
  if (displaced_) {
    Filter undisplaced = filter;
    undisplaced.reset_block(kGnssBias, Eigen::Vector3d::Zero(), filter.gnss_bias().position_std);
    const Measurement<3> again = measurement(undisplaced, fix);
    const AidingRecord tried = undisplaced.fuse(AidingSource::kGnssPosition, fix.t_us, again, gates_.nis[3]);
    if (tried.status == AidingStatus::kAccepted) {
      filter = undisplaced;
      displaced_ = false;
      return tried;
    }
  }
  const double gate = std::sqrt(gates_.nis[2]);
  const double alike = gate * std::sqrt(2.0 * (m.R(0, 0) + m.R(1, 1))) + 0.2 * off.head<2>().norm();
  if (rejected_ == 0 || (off - first_off_).head<2>().norm() > alike) {
    rejected_ = 1;
    first_off_ = off;
    return r;
  }
  ++rejected_;
  const Eigen::Matrix2d S(
      (Eigen::Matrix2d() << rejected.innovation_variance[0], 0.0, 0.0, rejected.innovation_variance[1]).finished());
  const double wrong_filter = log_tail(off.head<2>(), S);
  const double displaced = std::log(kDisplacedPrior) +
                           log_tail(off.head<2>(), kDisplacement * kDisplacement * Eigen::Matrix2d::Identity() + S);
  if (wrong_filter >= displaced) {
    if (rejected_ < kRunForFilter) return r;
    widen_filter(filter, fix, off);
    r = filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix), Gates::open().nis[3]);
    r.status = AidingStatus::kReset;
    displaced_ = false;
    return r;
  }
  if (rejected_ < kRunForReceiver) return r;
  BaseVector wider = BaseVector::Zero();
  wider.segment<3>(kGnssBias) = off;
  filter.widen(wider);
  displaced_ = true;
  return filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix), gates_.nis[3]);
}

/// (N.5.6): position by what the fixes differ, velocity by what made that since a fix was last used, attitude and
/// biases by their spread.
void GnssPositionControl::widen_filter(Filter& filter, const Queued& fix, const Eigen::Vector3d& off) const {
  const double since = std::max(1.0, seconds_between(used_at_us_, fix.t_us));
  constexpr double kTilt = 0.01, kHeading = 0.05;  // rad
  const VehicleFacts& v = config_.facts;
  const auto by = [&](int at, const Eigen::Vector3d& d) {
    BaseVector wider = BaseVector::Zero();
    wider.segment<3>(at) = d;
    filter.widen(wider);
  };
  by(kPos, off);
  for (int i = 0; i < 3; ++i) {
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    axis(i) = 1.0;
    by(kVel, (off.norm() / since) * axis);
    by(kAtt, (i == 2 ? kHeading : kTilt) * axis);
    by(kGyroBias, v.gyro_bias_std * axis);
    by(kAccelBias, v.accel_bias_std * axis);
  }
}

}  // namespace roadfix::navigation
