#include "navigation/step_detector.h"

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr int kApart_us = 500'000;      // between two moments
constexpr int kFirst_us = 1'000'000;    // between two of the first octave
constexpr int kRun_us = 1'500'000;      // from one surprise to the next of the same
constexpr double kMoreOf = 2.0;         // how much larger a surprise is that is another
constexpr double kMostOfIt = 0.5;       // of what the innovations have too much, at least, is the step's
constexpr double kLeastEvidence = 3.0;  // measurements; fewer are outliers
constexpr double kMemory = 16.0;        // s, as far back as a step is looked for
constexpr double kStartMemory = 120.0;  // s, of the evidence on what was wrong from the start
constexpr double kBeyondOthers = 3.0;   // by which the logarithm of the odds exceeds that of every other kind

struct Block {
  StepKind kind;
  int first, size;
  /// Minus the logarithm of how often it steps, against the receiver (assumed): that is displaced once an hour, wheels
  /// change or a clock is set once in seven, and an imu's bias, which temperature moves over minutes, hardly ever steps.
  /// One car in twenty has its antenna elsewhere.
  double rarity;
  bool any_size = false;  ///< what comes from outside the car has no largest size
};
constexpr int kBiases = 1, kDisplacement = 7, kDrag = 10, kImuClock = 13, kReceiverClock = 14,
              kWheelClock = 15;                      // columns
constexpr int kAntennaPlace = StepDetector::kWidth;  // the columns of the start stand behind those of a moment here
constexpr int kTakenBack = kAntennaPlace + StepDetector::kAntennaSize;  // and then what was taken back
constexpr std::array kBlocks = {Block{StepKind::kWheels, 0, 1, 2.0},
                                Block{StepKind::kImu, kBiases, 6, 7.0, true},
                                Block{StepKind::kReceiver, kDisplacement, 6, 0.0, true},
                                Block{StepKind::kReceiver, kDrag, 3, 0.0, true},  // from where it was: nothing jumps
                                Block{StepKind::kImuClock, kImuClock, 1, 2.0},
                                Block{StepKind::kReceiverClock, kReceiverClock, 1, 2.0, true},
                                Block{StepKind::kWheelClock, kWheelClock, 1, 2.0},
                                Block{StepKind::kLeverArm, kAntennaPlace, StepDetector::kAntennaSize, 3.0},
                                Block{StepKind::kNone, kTakenBack, 1, kBeyondOthers}};  // it was likelier by as much
constexpr bool of_receiver(StepKind kind) { return kind == StepKind::kReceiver || kind == StepKind::kReceiverClock; }
constexpr int column_of(int at) {
  if (at == kTakenBack) return 0;
  return at < kAntennaPlace ? at : at - kAntennaPlace;
}

/// A step given the evidence: mean, covariance, and the logarithm of the Bayes factor. Its prior is normal where it is not
/// larger than steps are; where it is, they are larger than was assumed, which the odds pay for.
struct Posterior {
  using Square = StepDetector::Small;
  using Vector = StepDetector::SmallVector;
  Square cov;
  Vector mean;
  double explained = 0.0, log_odds = 0.0;

  Posterior(const Square& information, const Vector& sum, const Vector& typical, bool any_size) {
    fit(information, sum, typical);
    if (!any_size) return;
    const Vector wide = typical.cwiseMax(mean.cwiseAbs());
    if (wide == typical) return;
    fit(information, sum, wide);
    log_odds -= (wide.array() / typical.array().max(kExact)).log().sum();
  }

 private:
  static constexpr double kExact = 1e-12;  // of a thing that does not step

  void fit(const Square& information, const Vector& sum, const Vector& prior) {
    Square A = prior.asDiagonal() * information * prior.asDiagonal();
    A.diagonal().array() += 1.0;
    const Eigen::LLT<Square> llt(A);
    const Square inverse = llt.solve(Square::Identity(sum.size(), sum.size()));
    cov = prior.asDiagonal() * inverse * prior.asDiagonal();
    mean = cov * sum;
    explained = mean.dot(sum);
    log_odds = 0.5 * explained - llt.matrixLLT().diagonal().array().log().sum();
  }
};

}  // namespace

/// How large steps are (assumed): a tyre that loses pressure or a wheel set that is changed, biases as much as they differ
/// from one turn-on to the next, a receiver that follows a reflection or is dragged off, a clock that is set by another one,
/// an arm that was read off wrong. Without an imu there is no clock of its own.
StepDetector::StepDetector(const VehicleFacts& v) {
  constexpr double kScale = 0.02, kArm = 0.5, kReceiver = 5.0, kRate = 0.5, kClock = 0.05;  // 1, m, m, m/s, s
  typical_ << kScale, Eigen::Vector3d::Constant(v.gyro_bias_std), Eigen::Vector3d::Constant(v.accel_bias_std),
      Eigen::Vector3d::Constant(kReceiver), Eigen::Vector3d::Constant(kRate), v.has_imu ? kClock : 0.0, kClock, kClock,
      Eigen::Vector3d::Constant(kArm), 1.0;
}

void StepDetector::begin(State& state, const BodyMotion& motion) {
  if (state.carried().cols() != kColumns) state.carry(kColumns);
  for (int m = kTaken; m >= 0; --m) begin(state, motion, m);  // of the start before the others, which note it
  next_us_ = 0;
  usual_ = 1.0;
  fresh_ = false;
  watches_ = true;
}

/// An imu's clock that is set forward by d leaves a gap of d in its stamps, over which the state is moved once too often, and
/// one that is set back leaves out as much, (N.5.9).
void StepDetector::begin_columns(State& state, const BodyMotion& motion, int moment) const {
  if (moment == kTaken) return;  // what was taken back stays it
  auto columns = state.carried().middleCols(first(moment), width(moment));
  columns.setZero();
  if (moment == kStart) {  // positions were taken from that antenna, and so are the estimate's
    columns.middleRows<3>(kAntenna).setIdentity();
    columns.middleRows<3>(kPos) = -state.x.R();
  } else {
    columns(kWheelScale, 0) = 1.0;
  }
  if (moment < kRecent) {
    columns.block<6, 6>(kGyroBias, kBiases).setIdentity();
    columns.block<3, 3>(kGnssBias, kDisplacement).setIdentity();
    columns(kImuOffset, kImuClock) = 1.0;
    const Eigen::Vector3d turned = state.x.R() * motion.rate;
    columns.block<3, 1>(kAtt, kImuClock) = -turned;
    columns.block<3, 1>(kVel, kImuClock) = turned.cross(state.x.nav.velocity) - motion.acceleration;
    columns.block<3, 1>(kPos, kImuClock) = turned.cross(state.x.nav.position - state.p_ref) - state.x.nav.velocity;
    columns(kPositionLatency, kReceiverClock) = columns(kVelocityLatency, kReceiverClock) = 1.0;
    columns(kWheelLatency, kWheelClock) = 1.0;
  }
}

void StepDetector::begin(State& state, const BodyMotion& motion, int moment) {
  begin_columns(state, motion, moment);
  information_[static_cast<size_t>(moment)].setZero();
  sum_.col(moment).setZero();
  age_(moment) = squares_(moment) = count_(moment) = 0.0;
  if (moment == kTaken && last_us_ != 0) age_(moment) = seconds_between(last_us_, state.x.t_us);
  if (moment < kStart)
    before_[static_cast<size_t>(moment)] = {information_[kStart].topLeftCorner<kAntennaSize, kAntennaSize>(),
                                            sum_.col(kStart).head<kAntennaSize>(), squares_(kStart), count_(kStart)};
}

void StepDetector::begin_after(State& state, const BodyMotion& motion, double seconds) {
  OfAntenna known;
  double age = 2.0 * kMemory;  // of the youngest moment before that
  for (int m = 0; m < kStart; ++m)
    if (age_(m) >= seconds && age_(m) < age) {
      age = age_(m);
      known = before_[static_cast<size_t>(m)];
    }
  begin(state, motion);
  information_[kStart].topLeftCorner<kAntennaSize, kAntennaSize>() = known.information;
  sum_.col(kStart).head<kAntennaSize>() = known.sum;
  squares_(kStart) = known.squares;
  count_(kStart) = known.count;
  before_.fill(known);
}

void StepDetector::begin_at_surprise(State& state, const BodyMotion& motion, double whitened_square, int rows) {
  const int64_t t_us = state.x.t_us;
  if (!watches_ || whitened_square < kChance * kChance + rows) return;
  const bool of_a_run = t_us < surprised_us_ + kRun_us;
  surprised_us_ = t_us;
  if (of_a_run && whitened_square < kMoreOf * surprise_) return;
  surprise_ = whitened_square;
  latest_ = 1 - latest_;
  begin(state, motion, kSurprises + latest_);
}

/// Two moments per octave: the first two take turns every second, the next two every two seconds, ... The ring takes
/// turns every time.
void StepDetector::advance(State& state, const BodyMotion& motion, bool displaced) {
  const int64_t t_us = state.x.t_us;
  if (!watches_ || t_us < next_us_) return;
  displaced_ = displaced;
  if (displaced) begin_columns(state, motion, kStart);
  next_us_ = t_us + kApart_us;
  ++turn_;
  begin(state, motion, kRing + turn_ % (kMoments - kRing));
  for (int octave = 0; octave < kOctaves; ++octave) {
    const int period = kFirst_us / kApart_us << octave;
    if (turn_ % period != 0) break;
    begin(state, motion, of_octave(octave) + (turn_ / period) % 2);
  }
}

void StepDetector::move(State& state, const Eigen::Matrix<double, 9, kInertialSize>& F,
                        const Eigen::Matrix<double, kWithoutCamera, 1>& decay, double T) {
  if (!watches_) return;
  Eigen::MatrixXd& errors = state.carried();
  moved_.noalias() = Eigen::Ref<const Eigen::MatrixXd>(F).lazyProduct(errors.topRows(kInertialSize));
  for (int i = kGnssBias; i < kWithoutCamera; ++i) errors.row(i) *= decay(i);
  errors.topRows(9) = moved_;
  for (int m = 0; m < kRecent; ++m)  // a displacement does not decay with the receiver's other errors, (N.5.9)
    for (int i = 0; i < 3; ++i) {
      const double d = decay(kGnssBias + i);
      errors(kGnssBias + i, first(m) + kDisplacement + i) += 1.0 - d;
      errors(kGnssBias + i, first(m) + kDrag + i) += age_(m) + T - d * age_(m);
    }
  age_.array() += T;
  const double kept = std::exp(-T / kStartMemory);
  information_[kStart] *= kept;
  sum_.col(kStart) *= kept;
  squares_(kStart) *= kept;
}

StepDetector::Rows StepDetector::explained(const State& state, const Eigen::Ref<const Eigen::MatrixXd>& H,
                                           const Eigen::Ref<const Eigen::MatrixXd>& L) {
  auto G = explained_.topRows(H.rows());
  G.noalias() = H.lazyProduct(state.carried().topRows(kWithoutCamera));
  for (int i = 0; i < L.rows(); ++i) {
    for (int k = 0; k < i; ++k) G.row(i) -= L(i, k) * G.row(k);
    G.row(i) /= L(i, i);
  }
  return G;
}

void StepDetector::weigh(const Eigen::Ref<const Eigen::MatrixXd>& G, const Eigen::Ref<const Eigen::VectorXd>& whitened,
                         bool antenna) {
  // Robust weight, as of Huber's estimator: single outliers decide nothing, those that agree with each other do.
  const double square = whitened.squaredNorm(), rows = static_cast<double>(whitened.size());
  const double weight = std::min(1.0, kChance * kChance * rows / square);
  for (int m = 0; m <= kTaken; ++m) {
    if (m == kStart && (!antenna || displaced_)) continue;
    const int n = width(m);
    const auto g = G.middleCols(first(m), n);
    information_[static_cast<size_t>(m)].topLeftCorner(n, n) += weight * g.transpose().lazyProduct(g);
    sum_.col(m).head(n) += weight * g.transpose().lazyProduct(whitened);
    squares_(m) += weight * square - rows;
    count_(m) += 1.0;
  }
  fresh_ = true;
}

bool StepDetector::doubts_last() const { return last_us_ != 0 && age_(kTaken) < kMemory; }

bool StepDetector::carries(int moment, int at, int size) const {
  if (at >= kWidth) return moment == (at == kTakenBack ? kTaken : kStart);
  return moment < kStart && at + size <= width(moment);
}

StepDetector::Fit StepDetector::best_of(size_t block) const {
  const Block& b = kBlocks[block];
  const double usual = std::max(1.0, usual_);
  const int column = column_of(b.first);
  Fit best;
  for (int m = 0; m <= kTaken; ++m) {
    if (count_(m) < kLeastEvidence || !carries(m, b.first, b.size) || (m == kTaken && !doubts_last())) continue;
    const Posterior p(information_[static_cast<size_t>(m)].block(column, column, b.size, b.size) / usual,
                      sum_.col(m).segment(column, b.size) / usual, typical_.segment(b.first, b.size), b.any_size);
    if (p.explained * usual < kMostOfIt * squares_(m) || p.log_odds <= best.likelihood) continue;
    best = {p.log_odds, {b.kind, p.log_odds - b.rarity, age_(m), first(m) + column, p.mean, p.cov}};
  }
  best.step.log_odds = best.likelihood - b.rarity;
  return best;
}

std::optional<StepDetector::Step> StepDetector::most_likely(double sigmas, bool displaced, bool receiver_waits) const {
  if (!watches_) return std::nullopt;
  std::array<Fit, kBlocks.size()> fits;
  size_t best = 0;
  for (size_t k = 0; k < kBlocks.size(); ++k) {
    if (displaced && (kBlocks[k].kind == StepKind::kReceiver || kBlocks[k].kind == StepKind::kLeverArm)) continue;
    fits[k] = best_of(k);
    if (fits[k].step.log_odds > fits[best].step.log_odds) best = k;
  }
  if (fits[best].step.log_odds < 0.5 * sigmas * sigmas) return std::nullopt;
  for (size_t k = 0; k < kBlocks.size(); ++k)
    if (kBlocks[k].kind != kBlocks[best].kind && (fits[best].step.log_odds < fits[k].step.log_odds + kBeyondOthers ||
                                                  fits[best].likelihood < fits[k].likelihood + kBeyondOthers))
      return std::nullopt;
  if (receiver_waits && of_receiver(kBlocks[best].kind)) return std::nullopt;
  return fits[best].step;
}

void StepDetector::take_back(const Step& step, State& state, const BodyMotion& motion) {
  const int n = state.size();
  const auto per_unit = state.carried().middleCols(step.column, step.size.size()).topRows(n);
  ErrorVector d = per_unit * step.size;
  state.retract(d);
  const ErrorVector made = d;
  const auto widen = [&] {
    for (int j = 0; j < n; ++j) state.P().col(j).head(n) += d(j) * d;
  };
  const Small root = step.cov.llt().matrixL();
  for (int k = 0; k < root.cols(); ++k) {
    d = per_unit * root.col(k);
    widen();
  }
  auto last = state.carried().col(first(kTaken));
  if (doubts_last() && last_kind_ != step.kind && step.kind != StepKind::kNone) {
    d = last.head(n);
    widen();
  }
  if (!doubts_last() || last_kind_ != step.kind) last.setZero();
  last.head(n) += made;
  last_kind_ = step.kind;
  const bool watched = step.kind == StepKind::kReceiver || step.kind == StepKind::kLeverArm;
  last_us_ = watched || step.kind == StepKind::kNone ? 0 : state.x.t_us;
  if (step.kind == StepKind::kLeverArm) return begin(state, motion);
  begin_after(state, motion, step.age);
}

}  // namespace roadfix::navigation
