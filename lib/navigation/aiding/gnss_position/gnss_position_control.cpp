#include "navigation/aiding/gnss_position/gnss_position_control.h"

#include <algorithm>
#include <cmath>

#include "navigation/aiding/gnss_error_states.h"
#include "navigation/aiding/gnss_position/gnss_position_model.h"
#include "navigation/aiding/second_order.h"
#include "statistics/chance.h"

namespace roadfix::navigation {

namespace {

constexpr double kForEver = 1e12;  // s
// Of a fixed carrier phase: multipath of a few millimetres (3.5 of a usual claim of 20) lasts, and no way is known well
// enough to show it.
constexpr LastingError kPhase = {0.03, 1.0 / 20.0};
// The velocity of a filter that is aided is off by the same for about so long: what the driven way drifts by is a random
// walk of twice its variance times this, and no less than a centimetre.
constexpr double kVelocityTime = 1.0;  // s
constexpr double kWheelTime = 0.25;    // s, likewise, of a car without an imu: its speed is measured anew each time
constexpr double kLeastDrift = 0.01;   // m/sqrt(s)
// A code receiver without an imu beside it: from multipath of a moving car to smoothing, and hardly ever white.
constexpr LastingErrorModels::Times kStreetTimes = {3.0, 10.0, 30.0};  // s
constexpr double kStreetWhite = 0.1;
constexpr double kSettled = 0.1;  // of a fix's sigma: less is over
// m: how far off a displaced receiver typically is, and one without a fixed phase that comes back from an outage.
constexpr double kDisplacement = 5.0;
constexpr double kDisplacedPrior = 0.01;    // of a run of rejected fixes
constexpr double kDisplacedWalk = 0.5;      // m/sqrt(s), of a displacement
constexpr double kLongestDisplaced = 60.0;  // s: for longer a receiver is seldom displaced, and the filter is wrong
constexpr double kBack = 7.0;               // logarithm of the odds (1000 to 1) that it is no longer displaced
constexpr double kPatience = 3.0;           // s of rejected fixes, for which nothing is missing, and after them
constexpr double kTooLong = 5.0;            // s of rejected fixes that agree, without a step that explains them
constexpr double kTailFreedom = 3.0;        // Student's t: errors of filters and receivers have heavy tails
constexpr int kRunForFilter = 2, kRunForReceiver = 3;  // rejected fixes that agree, to decide

/// Student's t in two dimensions, without its constant.
double log_tail(const Eigen::Vector2d& off, const Eigen::Matrix2d& cov) {
  const double m = off.dot(cov.inverse() * off);
  return -0.5 * std::log(cov.determinant()) - 0.5 * (kTailFreedom + 2.0) * std::log1p(m / kTailFreedom);
}

Measurement<2> level_of(const Measurement<3>& all) {
  Measurement<2> level;
  level.residual = all.residual.head<2>();
  level.H = all.H.topRows<2>();
  level.R = all.R.topLeftCorner<2, 2>();
  return level;
}

/// Level, m: a fix less the antenna, with the receiver's error in it.
Eigen::Vector2d off_way(const Filter& filter, const Queued& fix) {
  const State& s = filter.state();
  const Measurement<3> m = gnss_position(s, filter.motion(), fix.value, fix.cov, fix.ahead(s.x));
  return (m.residual + s.x.gnss_bias + s.x.gnss_return).head<2>();
}

/// The receiver may be off by this much more along each level axis (sigma, m).
void widen_bias(Filter& filter, const Eigen::Vector3d& std) {
  for (int i = 0; i < 3; ++i) {
    BaseVector wider = BaseVector::Zero();
    wider(kGnssBias + i) = std(i);
    filter.widen(wider);
  }
}

/// It is displaced, in a direction that nobody knows: what fixes are off by, `off`, has the filter's own error in it, too.
void widen_bias_all_round(Filter& filter, const Eigen::Vector3d& off) {
  widen_bias(filter, Eigen::Vector3d::Constant(off.norm()));
}

/// What a receiver brought back has faded.
void settle(Filter& filter, const Queued& fix) {
  const State& s = filter.state();
  if (s.gnss_returns() && gnss_return_size(s) < kSettled * std::sqrt(fix.cov(0, 0))) end_gnss_return(filter);
}

const Eigen::Vector3d kReturn(kDisplacement, kDisplacement, 2.0 * kDisplacement);

}  // namespace

GnssPositionControl::GnssPositionControl(const NavigationConfig& config)
    : config_(config), gates_(config.aiding.gate_sigma), open_(Gates::open()) {
  for (size_t i = 0; i < receivers_.size(); ++i)
    if (heavy_tailed(static_cast<FixType>(i))) receivers_[i].lasting = LastingErrorModels(kStreetTimes, kStreetWhite);
}

LastingError GnssPositionControl::lasting(FixType type) const {
  if (!config_.aiding.lasting_errors) return {};
  return type == FixType::kRtkFixed ? kPhase : receiver(type).lasting.mean();
}

double GnssPositionControl::variance_factor(FixType type) const {
  const Receiver& r = receiver(type);
  const double scale = r.scale.variance_factor();
  return heavy_tailed(type) ? std::max(scale, r.lasting.variance_factor()) : scale;
}

Eigen::Vector3d GnssPositionControl::lasting_std(const GnssFix& fix) const {
  Eigen::Vector3d variance = lasting(fix.fix_type).share * variance_factor(fix.fix_type) * fix.cov_enu.diagonal();
  return variance.cwiseSqrt();
}

Eigen::Vector3d GnssPositionControl::return_std(const GnssFix& fix) const {
  return returns(fix.t_us, fix.fix_type) ? kReturn : Eigen::Vector3d::Zero();
}

bool GnssPositionControl::waits(int64_t t_us) const {
  return outage_ || run_.over_within(t_us, kPatience) || (rejects() && seconds_between(used_at_us_, t_us) < kPatience);
}

/// What was rejected has moved nothing, and the way is what it was.
void GnssPositionControl::displace(Filter& filter) {
  set_displaced(filter.state().x.t_us);
  widen_bias_all_round(filter, run_.newest_off());
  filter.watch_for_steps_after(run_.since_us());
}

bool GnssPositionControl::after_outage(int64_t t_us) const {
  return used_at_us_ != 0 && (outage_ || seconds_between(seen_at_us_, t_us) > kOutage);
}

/// What displaced the receiver is over with its signals.
void GnssPositionControl::see(int64_t t_us) {
  if (!outage_ && after_outage(t_us)) {
    outage_ = true;
    displaced_since_us_ = 0;
  }
  seen_at_us_ = t_us;
}

/// After an outage a receiver without a fixed phase may come back displaced.
bool GnssPositionControl::returns(int64_t t_us, FixType type) const {
  return after_outage(t_us) && type != FixType::kRtkFixed && config_.aiding.lasting_errors;
}

GnssPositionControl::Bias GnssPositionControl::bias_of(const Queued& fix) const {
  Bias bias;
  bias.like = lasting(fix.fix_type);
  bias.std = (bias.like.share * variance_factor(fix.fix_type) * fix.cov.diagonal()).cwiseSqrt();
  bias.anew = used_at_us_ == 0 || after_outage(fix.t_us) || fix.fix_type != last_type_;
  bias.returns = returns(fix.t_us, fix.fix_type);
  return bias;
}

/// Where b begins anew it is part of the noise, so that a rejected fix leaves the filter as it was.
Measurement<3> GnssPositionControl::measurement(const Filter& filter, const Queued& fix, const Bias& bias) const {
  const double white = (1.0 - bias.like.share) * variance_factor(fix.fix_type);
  Measurement<3> m =
      gnss_position(filter.state(), filter.motion(), fix.value, white * fix.cov, fix.ahead(filter.state().x));
  add_second_order(m, filter.state(), filter.motion());
  m.shows_steps = !displaced();  // how a displacement moves is assumed
  if (!bias.anew) return m;
  m.residual += filter.state().x.gnss_bias;
  m.H.middleCols<3>(kGnssBias).setZero();
  m.R.diagonal() += bias.std.cwiseAbs2();
  if (!bias.returns) return m;
  m.residual += filter.state().x.gnss_return;
  m.H.middleCols<3>(kGnssReturn).setZero();
  m.R.diagonal() += kReturn.cwiseAbs2();
  return m;
}

/// How b moves from now on.
void GnssPositionControl::set_noise(Filter& filter, const Bias& bias) const {
  filter.gnss_bias().position_std = bias.std;
  for (int i = 0; i < 3; ++i) {
    const bool off = displaced() || (i == 2 && height_displaced_);
    filter.gnss_bias().position_time(i) = off ? kForEver : 1.0 / bias.like.rate;
    filter.gnss_bias().position_walk(i) = off ? kDisplacedWalk : 0.0;
  }
}

/// Where b's share turns out to be another, what of the fixes went to the place and what to b was wrong from the start.
void GnssPositionControl::set_bias(Filter& filter, const Bias& bias) {
  set_noise(filter, bias);
  const bool other_share = share_ > 0.0 && bias.like.share != share_;
  if (!bias.anew && other_share && config_.facts.has_imu && !displaced())
    rescale_gnss_bias(filter, kGnssBias, bias.like.share / share_, bias.std.cwiseAbs2());
  share_ = bias.like.share;
  begin(filter, bias);
}

void GnssPositionControl::begin(Filter& filter, const Bias& bias) const {
  if (bias.anew) reset_gnss_bias(filter, bias.std);
  if (bias.returns) begin_gnss_return(filter, kReturn);
}

AidingRecord GnssPositionControl::try_on(Filter& filter, const Queued& fix) const {
  Bias bias = bias_of(fix);
  set_noise(filter, bias);
  if (!displaced()) begin(filter, bias);
  bias = bias.begun();
  return filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix, bias), Gates::open().nis[3]);
}

/// (N.5.13): errors of Student's t. What a fix misses by beyond its noise widens that noise by the weight of the scale
/// mixture, (nu + m) / (nu + d); no gate.
AidingRecord GnssPositionControl::use_heavy_tailed(Filter& filter, const Queued& fix, const Bias& bias) {
  AidingRecord r = filter.judge(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix, bias), open_.nis[3]);
  if (r.status != AidingStatus::kAccepted) return r;
  const double wider = std::max(1.0, (kTailFreedom + r.nis) / (kTailFreedom + r.dof));
  set_bias(filter, bias);
  Measurement<3> m = measurement(filter, fix, bias.begun());
  m.R *= wider;
  (void)filter.fuse(AidingSource::kGnssPosition, fix.t_us, m, open_.nis[3]);
  r.nis /= wider;
  learn(fix, r);
  return r;
}

AidingRecord GnssPositionControl::use(Filter& filter, const Queued& fix) {
  see(fix.t_us);
  Bias bias = bias_of(fix);
  const Eigen::Vector2d before = off_way(filter, fix);
  if (heavy_tailed(fix.fix_type)) {
    const AidingRecord r = use_heavy_tailed(filter, fix, bias);
    if (r.status != AidingStatus::kAccepted) return r;
    watch(filter, fix, bias, before);
    settle(filter, fix);
    note(fix.t_us, fix.fix_type);
    return r;
  }
  AidingRecord r = filter.judge(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix, bias), gates_.nis[3]);
  if (r.status == AidingStatus::kGated && filter.state().gnss_returns() && jumped_back(filter, fix, bias)) {
    bias.returns = true;
    r.status = AidingStatus::kAccepted;
  }
  if (displaced() && r.status != AidingStatus::kBadInput) {
    if (is_back(filter, fix, bias, r.log_likelihood)) {
      bias.anew = true;
      r.status = AidingStatus::kAccepted;
    } else if (seconds_between(displaced_since_us_, fix.t_us) > kLongestDisplaced) {
      r = believe(filter, fix, bias);
    }
  }
  if (r.status == AidingStatus::kAccepted) {
    set_bias(filter, bias);
    bias = bias.begun();
    (void)filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix, bias), Gates::open().nis[3]);
    if (!displaced()) learn(fix, r);
    if (std::abs(filter.state().x.gnss_bias.z()) < kChance * bias.std.z()) height_displaced_ = false;
  } else if (r.status == AidingStatus::kGated) {
    const AidingRecord level = use_level(filter, fix, bias);
    r = level.status == AidingStatus::kAccepted ? level : decide(filter, fix, bias, r);
  }
  if (r.status == AidingStatus::kAccepted) watch(filter, fix, bias_of(fix), before);
  settle(filter, fix);
  if (r.status == AidingStatus::kReset) forget_way();
  if (r.status == AidingStatus::kAccepted || r.status == AidingStatus::kReset) {
    note(fix.t_us, fix.fix_type);
    run_.end(fix.t_us, r.status == AidingStatus::kAccepted && !displaced());
  }
  return r;
}

/// What the receiver brought back is gone at once: a fix without it agrees.
bool GnssPositionControl::jumped_back(const Filter& filter, const Queued& fix, const Bias& bias) const {
  Measurement<3> m = measurement(filter, fix, bias);
  m.residual += filter.state().x.gnss_return;
  m.H.middleCols<3>(kGnssReturn).setZero();
  return filter.judge(AidingSource::kGnssPosition, fix.t_us, m, gates_.nis[3]).status == AidingStatus::kAccepted;
}

/// A displaced receiver that comes back, (N.5.6): cumulative sum of the log-likelihood ratios of fixes.
bool GnssPositionControl::is_back(Filter& filter, const Queued& fix, const Bias& bias, double log_likelihood) {
  Bias none = bias;
  none.anew = true;
  const Measurement<3> m = measurement(filter, fix, none);
  const AidingRecord r = filter.judge(AidingSource::kGnssPosition, fix.t_us, m, gates_.nis[3]);
  // The height drifts in an outage more than the filter knows, and is no reason to stay displaced.
  const AidingRecord level = filter.judge(AidingSource::kGnssPosition, fix.t_us, level_of(m), gates_.nis[2]);
  if (level.status != AidingStatus::kAccepted) {
    back_ = 0.0;
    return false;
  }
  back_ = std::max(0.0, back_ + r.log_likelihood - log_likelihood);
  if (back_ < kBack) return false;
  displaced_since_us_ = 0;
  return true;
}

/// What was taken for a displacement is the filter's error.
AidingRecord GnssPositionControl::believe(Filter& filter, const Queued& fix, const Bias& bias) {
  const Eigen::Vector3d off = filter.state().x.gnss_bias;
  displaced_since_us_ = 0;
  Bias none = bias;
  none.anew = true;
  set_bias(filter, none);
  none = none.begun();
  widen_filter(filter, fix, off);
  AidingRecord r =
      filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix, none), Gates::open().nis[3]);
  r.status = AidingStatus::kReset;
  return r;
}

/// (N.5.3)
void GnssPositionControl::learn(const Queued& fix, const AidingRecord& r) {
  receivers_[static_cast<size_t>(fix.fix_type)].scale.learn(r);
}

/// A used fix shows what of its kind's errors lasts, (N.5.4), unless what it has brought back from an outage is still there.
void GnssPositionControl::watch(const Filter& filter, const Queued& fix, const Bias& bias,
                                const Eigen::Vector2d& before) {
  LastingErrorModels& models = receivers_[static_cast<size_t>(fix.fix_type)].lasting;
  if (bias.anew) models.begin_anew();
  if (!config_.aiding.lasting_errors || displaced() || filter.state().gnss_returns()) return models.begin_anew();
  const Eigen::Array2d velocity = filter.state().P().diagonal().segment<2>(kVel);
  models.add({fix.t_us, before, off_way(filter, fix), fix.cov.diagonal().head<2>(),
              2.0 * (config_.facts.has_imu ? kVelocityTime : kWheelTime) * velocity + kLeastDrift * kLeastDrift});
}

/// The height alone contradicts: it becomes an error of the receiver's height, which fades as its errors do.
AidingRecord GnssPositionControl::use_level(Filter& filter, const Queued& fix, const Bias& bias) {
  const AidingRecord r =
      filter.judge(AidingSource::kGnssPosition, fix.t_us, level_of(measurement(filter, fix, bias)), gates_.nis[2]);
  if (r.status != AidingStatus::kAccepted) return r;
  height_displaced_ = true;
  set_bias(filter, bias);
  const Bias now = bias.begun();
  const Measurement<3> all = measurement(filter, fix, now);
  (void)filter.fuse(AidingSource::kGnssPosition, fix.t_us, level_of(all), Gates::open().nis[2]);
  widen_bias(filter, all.residual(2) * Eigen::Vector3d::UnitZ());
  return r;
}

/// (N.5.5): an outlier, a displaced receiver or a wrong filter? Between two fixes of a second a filter does not jump; after
/// an outage either may be off, and sizes decide. What grows while fixes come is the step detector's.
AidingRecord GnssPositionControl::decide(Filter& filter, const Queued& fix, const Bias& bias,
                                         const AidingRecord& rejected) {
  AidingRecord r = rejected;
  const Measurement<3> m = measurement(filter, fix, bias);
  filter.reject(m);
  const Eigen::Vector3d off = m.residual;
  const double noise = std::sqrt(2.0 * gates_.nis[2] * (m.R(0, 0) + m.R(1, 1)));
  const RejectedRun::Next next = run_.add(fix.t_us, off, noise);
  if (next == RejectedRun::Next::kDiffers) learn(fix, r);
  if (next != RejectedRun::Next::kAgrees) return r;
  const bool late = seconds_between(used_at_us_, run_.since_us()) > kOutage;
  if (!late && seconds_between(run_.since_us(), fix.t_us) < kTooLong) return r;
  const Eigen::Matrix2d S =
      Eigen::Vector2d(rejected.innovation_variance[0], rejected.innovation_variance[1]).asDiagonal();
  const double wrong_filter = log_tail(off.head<2>(), S);
  const double displaced = std::log(kDisplacedPrior) +
                           log_tail(off.head<2>(), kDisplacement * kDisplacement * Eigen::Matrix2d::Identity() + S);
  const bool filter_is_wrong = wrong_filter >= displaced;
  if (run_.agreeing() < (filter_is_wrong ? kRunForFilter : kRunForReceiver)) return r;
  if (!filter_is_wrong) {
    set_displaced(fix.t_us);
    filter.watch_for_steps_after(run_.since_us());
  }
  set_bias(filter, bias);
  const Bias now = bias.begun();
  if (filter_is_wrong)
    widen_filter(filter, fix, off);
  else
    widen_bias_all_round(filter, off);
  r = filter.fuse(AidingSource::kGnssPosition, fix.t_us, measurement(filter, fix, now), Gates::open().nis[3]);
  if (filter_is_wrong) r.status = AidingStatus::kReset;
  return r;
}

/// (N.5.6): position by what the fixes differ, velocity by what made that since a fix was last used, attitude and biases
/// by their spread.
void GnssPositionControl::widen_filter(Filter& filter, const Queued& fix, const Eigen::Vector3d& off) const {
  constexpr double kTilt = 0.01, kHeading = 0.05;  // rad
  const double since = std::max(1.0, seconds_between(used_at_us_, fix.t_us));
  const VehicleFacts& v = config_.facts;
  const auto widen = [&](int at, const Eigen::Vector3d& d) {
    BaseVector wider = BaseVector::Zero();
    wider.segment<3>(at) = d;
    filter.widen(wider);
  };
  widen(kPos, off);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
    widen(kVel, (off.norm() / since) * axis);
    widen(kAtt, (i == 2 ? kHeading : kTilt) * axis);
    widen(kGyroBias, v.gyro_bias_std * axis);
    widen(kAccelBias, v.accel_bias_std * axis);
  }
}

}  // namespace roadfix::navigation
