#include "fusion/fusion.h"

#include <algorithm>
#include <cmath>

#include "fusion/saved.h"
#include "geometry/euler.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr FusionChannel kAll[] = {FusionChannel::kIns, FusionChannel::kVo, FusionChannel::kWheel};
constexpr double kLatestEpoch = 0.4;    ///< s, by which an epoch waits for a picture
constexpr double kLatestPicture = 0.5;  ///< s behind the others
constexpr double kRepeated = 0.3;       ///< s, of one pose: frozen, if the vehicle moves
constexpr double kMoves = 0.5;          ///< m/s
constexpr double kLeastWay = 2.0;       ///< m, of a window that shows a scale
constexpr double kRestartAfter = 0.5;   ///< s, for which vision must be lost
constexpr double kRawScale = 1.0;       ///< sigma of a log scale of which nothing is known

}  // namespace

Fusion::Fusion(const FusionConfig& config)
    : config_(config),
      channels_{PoseChannel(FusionChannel::kIns, config.ins), PoseChannel(FusionChannel::kVo, config.vo),
                PoseChannel(FusionChannel::kWheel, config.wheel)},
      witnesses_(config.agreement),
      local_(config),
      failover_(config) {}

void Fusion::set_gnss(int64_t t_us, bool present) { failover_.set_gnss(t_us, present); }

FuseStatus Fusion::add(const ChannelSample& s) {
  const auto refused = [&](FuseStatus status) {
    record(s.channel, status);
    return status;
  };
  // Vision comes later than the others; what it says of the past still counts.
  const double late = s.channel == FusionChannel::kVo ? kLatestPicture : 0.0;
  if (started_ && seconds_between(s.odometry.t_us, t_us_) > late) return refused(FuseStatus::kNotReady);
  const FuseStatus status = at(s.channel).add(s);
  if (status == FuseStatus::kBadInput || status == FuseStatus::kNotReady) return refused(status);
  if (!started_ && status == FuseStatus::kBadQuality) return refused(status);
  const double dt = started_ ? std::max(0.0, seconds_between(t_us_, s.odometry.t_us)) : 0.0;
  t_us_ = started_ ? std::max(t_us_, s.odometry.t_us) : s.odometry.t_us;
  if (!started_) {
    local_.start(t_us_);
    failover_.start(local_.pose());
    started_ = true;
  }
  watch_frozen();
  const bool fresh = status != FuseStatus::kBadQuality;
  local_.add(s.channel, fresh, channels_, t_us_);
  failover_.add(s.channel, fresh, channels_, local_, t_us_);
  epoch(s);
  if (s.channel == FusionChannel::kVo) watch_vision(s);
  output_.settle(now(), dt);
  record(s.channel, status);
  return status;
}

/// Compares at a picture's time, for pictures come seldom; without vision, when it is due.
void Fusion::epoch(const ChannelSample& s) {
  const bool picture = s.channel == FusionChannel::kVo && channel(FusionChannel::kVo).alive(t_us_);
  const double due = Witnesses::kSpacing + (picture ? -0.01 : kLatestEpoch);
  const int64_t at_us = picture ? s.odometry.t_us : t_us_;
  if (witnesses_.last_us() && seconds_between(*witnesses_.last_us(), at_us) < due) return;
  witnesses_.add(epoch_at(at_us), channels_);
  judge();
  calibrate();
  weigh();
}

Epoch Fusion::epoch_at(int64_t at_us) const {
  Epoch e;
  e.t_us = at_us;
  for (const FusionChannel c : kAll) {
    const PoseChannel& channel = this->channel(c);
    Witness& w = e.channels[static_cast<std::size_t>(c)];
    w.comparable = channel.moves(t_us_);
    if (!w.comparable) continue;
    w.segment = channel.track().segment();
    w.track = channel.way(at_us);
    if (c != FusionChannel::kIns) continue;
    w.track = channel.pose(at_us);
    w.P = channel.view().P;
    w.velocity_variance = 0.5 * channel.odometry().cov_velocity.topLeftCorner<2, 2>().trace();
  }
  return e;
}

/// Who contradicts whom: an INS that two witnesses contradict which agree is wrong; a witness is, that the INS or the
/// wheels contradict. Wheels before vision: Ock et al. (2020), (15).
void Fusion::judge() {
  using enum FusionChannel;
  const auto contradict = [&](FusionChannel a, FusionChannel b) {
    return witnesses_.agreement(a, b) == WitnessAgreement::kContradict;
  };
  const auto fits = [&](FusionChannel a, FusionChannel b) {
    const auto& c = witnesses_.comparison(a, b);
    return c.done && c.fits && !contradict(a, b);
  };
  const bool witnesses_count = !channel(kVo).health().on_trial() && !channel(kWheel).health().on_trial();
  const bool agree = witnesses_.agreement(kVo, kWheel) == WitnessAgreement::kAgree;
  // Fixes that are back after an outage may correct it by more than it claims, and be displaced themselves for a while.
  const double returned = failover_.gnss_for(t_us_);
  const bool settles = failover_.gnss() && returned < Witnesses::kLong * Witnesses::kSpacing;
  const bool ins_bad = witnesses_count && !settles && contradict(kIns, kVo) && contradict(kIns, kWheel) && agree;
  const bool wheel_bad = contradict(kIns, kWheel) && !ins_bad;
  const bool vo_bad = (contradict(kIns, kVo) && !ins_bad) || (contradict(kVo, kWheel) && !wheel_bad);
  const auto alone = [&](FusionChannel c) {
    return std::none_of(std::begin(kAll), std::end(kAll),
                        [&](FusionChannel o) { return o != c && channel(o).good(t_us_); });
  };
  const bool vo_fits = fits(kIns, kVo) || fits(kVo, kWheel) || alone(kVo);
  const bool wheel_fits = fits(kIns, kWheel) || fits(kVo, kWheel) || alone(kWheel);
  at(kIns).health().judge(ins_bad, true);
  at(kVo).health().judge(vo_bad, vo_fits);
  at(kWheel).health().judge(wheel_bad, wheel_fits);
  failover_.judge(ins_bad, !contradict(kIns, kVo) && !contradict(kIns, kWheel), channels_, t_us_);
}

/// While fixes hold the INS's pose, it shows what the others' motions have wrong all along, and how noisy they are. Without
/// it vision, whose yaw does not drift, shows what turns the wheels.
void Fusion::calibrate() {
  const double window = Witnesses::kCalibration * Witnesses::kSpacing;
  if (epochs_ % Witnesses::kShort == 1) {  // each shows what of their difference the other does not explain
    adapt(FusionChannel::kVo, FusionChannel::kWheel);
    adapt(FusionChannel::kWheel, FusionChannel::kVo);
  }
  const bool held = failover_.follows() && failover_.gnss_for(t_us_) >= window;
  const bool learns = ++epochs_ >= Witnesses::kCalibration;
  if (learns) epochs_ = 0;
  if (held) {
    for (const FusionChannel c : {FusionChannel::kVo, FusionChannel::kWheel}) {
      if (learns) learn(c);
      if (epochs_ % Witnesses::kShort == 0) adapt(c, FusionChannel::kIns);
    }
  } else if (learns && !channel(FusionChannel::kIns).alive(t_us_)) {
    learn_turns();
  }
}

void Fusion::learn(FusionChannel c) {
  const auto ins = witnesses_.window(FusionChannel::kIns, Witnesses::kCalibration, channels_);
  const auto own = witnesses_.window(c, Witnesses::kCalibration, channels_);
  if (!ins || !own || ins->motion.head<2>().norm() < kLeastWay) return;
  ChannelCalibration& calibration = at(c).calibration();
  if (calibration.covariance()(kScale, kScale) > kRawScale * kRawScale) {
    const double ratio = own->motion.head<2>().norm() / ins->motion.head<2>().norm();
    if (ratio > 0.0) calibration.set_scale(calibration.mean()(kScale) + std::log(ratio), 0.1);
    return;
  }
  if (witnesses_.agreement(FusionChannel::kIns, c) != WitnessAgreement::kContradict)
    calibration.learn(*own, ins->motion, ins->S);
}

void Fusion::learn_turns() {
  const auto vision = witnesses_.window(FusionChannel::kVo, Witnesses::kCalibration, channels_);
  const auto wheels = witnesses_.window(FusionChannel::kWheel, Witnesses::kCalibration, channels_);
  const bool agree = witnesses_.agreement(FusionChannel::kVo, FusionChannel::kWheel) == WitnessAgreement::kAgree;
  if (!vision || !wheels || !agree || vision->motion.head<2>().norm() < kLeastWay) return;
  at(FusionChannel::kWheel).calibration().learn_turns(*wheels, vision->motion, vision->S);
}

void Fusion::adapt(FusionChannel c, FusionChannel reference) {
  const auto other = witnesses_.window(reference, Witnesses::kShort, channels_);
  const auto own = witnesses_.window(c, Witnesses::kShort, channels_);
  if (!other || !own || witnesses_.agreement(reference, c) != WitnessAgreement::kAgree) return;
  at(c).errors().adapt(difference_of(other->motion, own->motion), own->motion, own->dt, other->S + own->S - own->Q);
}

/// A pose that is repeated although its own velocity, or another channel, says that the vehicle moves.
void Fusion::watch_frozen() {
  for (const FusionChannel c : kAll) {
    PoseChannel& own = at(c);
    if (!own.alive(t_us_)) continue;
    bool moves = own.odometry().velocity.norm() > kMoves;
    for (const FusionChannel other : kAll)
      moves = moves || (other != c && channel(other).good(t_us_) && std::abs(channel(other).speed()) > kMoves);
    own.health().set_frozen(moves && own.repeated(t_us_) > kRepeated);
  }
}

/// Keeps the tie between vision and POSE_LOCAL while they agree; asks the vision to start again where it is lost or
/// wrong and somebody else knows where it should.
void Fusion::watch_vision(const ChannelSample& s) {
  const PoseChannel& vision = channel(FusionChannel::kVo);
  const ChannelState state = vision.state(t_us_);
  const bool bad =
      state == ChannelState::kInvalid || state == ChannelState::kContradicted || state == ChannelState::kFrozen;
  if (!bad) {
    vision_bad_since_us_.reset();
    const bool doubted =
        witnesses_.agreement(FusionChannel::kVo, FusionChannel::kWheel) == WitnessAgreement::kContradict;
    if (state == ChannelState::kGood && !doubted && witnesses_.last_us() == s.odometry.t_us)
      restart_.tie(s.odometry.T_frame_vehicle, local_.odometry(channels_, s.odometry.t_us));
    return;
  }
  if (!vision_bad_since_us_) vision_bad_since_us_ = t_us_;
  const auto witness = local_.leader();
  if (!witness || witness == FusionChannel::kVo || seconds_between(*vision_bad_since_us_, t_us_) < kRestartAfter)
    return;
  restart_.ask(t_us_, config_.restart_every,
               state == ChannelState::kInvalid ? "vision says that it is lost" : "vision contradicts");
}

void Fusion::record(FusionChannel c, FuseStatus status) {
  FusionChannelReport& r = reports_[static_cast<std::size_t>(c)];
  r.status = status;
  if (status == FuseStatus::kAccepted && channel(c).state(t_us_) == ChannelState::kContradicted)
    r.status = FuseStatus::kGated;
  r.nis = 0.0;
  r.dof = 0;
  for (const FusionChannel other : kAll) {
    if (other == c || r.dof > 0) continue;
    const Witnesses::Comparison& compared = witnesses_.comparison(c, other);
    if (!compared.done) continue;
    r.nis = compared.nis;
    r.dof = 3;
    r.innovation = compared.difference;
    r.innovation_variance = compared.S.diagonal();
  }
}

/// Shares of the reliability: the inverse of the expected error of a motion over 10 s.
void Fusion::weigh() {
  double sum = 0.0;
  for (const FusionChannel c : kAll) {
    const bool counts = channel(c).good(t_us_);
    const double weight = counts ? 1.0 / channel(c).expected_error(channel(c).speed()) : 0.0;
    reports_[static_cast<std::size_t>(c)].weight = weight;
    sum += weight;
  }
  for (FusionChannelReport& r : reports_) r.weight = sum > 0.0 ? r.weight / sum : 0.0;
}

ChannelSample Fusion::at_present(ChannelSample sample) const {
  Odometry& o = sample.odometry;
  if (!started_ || o.t_us >= t_us_) return sample;
  const Planar motion = motion_between(local_planar(o.t_us), local_planar(t_us_));
  o.T_frame_vehicle = o.T_frame_vehicle * SE3{quaternion({motion.z(), 0.0, 0.0}), {motion.x(), motion.y(), 0.0}};
  o.t_us = t_us_;
  return sample;
}

VisionRestart Fusion::take_restart(const Odometry& local) {
  return restart_.take(local, channel(FusionChannel::kVo).calibration().length());
}

void Fusion::save(StateWriter& writer) const { SnapshotWriter{writer}(*this); }

void Fusion::load(StateReader& reader) { SnapshotReader{reader}(*this); }

}  // namespace roadfix
