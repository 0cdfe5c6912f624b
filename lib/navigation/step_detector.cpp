#include "navigation/step_detector.h"

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr int kApart_us = 500'000;      // between two moments
constexpr int kFirst_us = 1'000'000;    // between two of the first octave
constexpr double kMoreOf = 2.0;         // of two surprises within a second, that the second is another
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
};
constexpr int kBiases = 1, kDisplacement = 7, kDrag = 10, kImuClock = 13, kReceiverClock = 14,
              kWheelClock = 15;                      // columns
constexpr int kAntennaPlace = StepDetector::kWidth;  // the columns of the start stand behind those of a moment here
constexpr std::array kBlocks = {Block{StepKind::kWheels, 0, 1, 2.0},
                                Block{StepKind::kImu, kBiases, 6, 7.0},
                                Block{StepKind::kReceiver, kDisplacement, 6, 0.0},
                                Block{StepKind::kReceiver, kDrag, 3, 0.0},  // from where it was: nothing jumps
                                Block{StepKind::kImuClock, kImuClock, 1, 2.0},
                                Block{StepKind::kReceiverClock, kReceiverClock, 1, 2.0},
                                Block{StepKind::kWheelClock, kWheelClock, 1, 2.0},
                                Block{StepKind::kLeverArm, kAntennaPlace, StepDetector::kAntennaSize, 3.0}};
constexpr int column_of(int at) { return at < StepDetector::kWidth ? at : at - StepDetector::kWidth; }

/// A step of normal prior given the evidence: mean, covariance, and the logarithm of the Bayes factor.
struct Posterior {
  using Square = StepDetector::Small;
  using Vector = StepDetector::SmallVector;
  Square cov;
  Vector mean;
  double explained = 0.0, log_odds = 0.0;

  Posterior(const Square& information, const Vector& sum, const Vector& typical) {
    Square A = typical.asDiagonal() * information * typical.asDiagonal();
    A.diagonal().array() += 1.0;
    const Eigen::LLT<Square> llt(A);
    const Square inverse = llt.solve(Square::Identity(sum.size(), sum.size()));
    cov = typical.asDiagonal() * inverse * typical.asDiagonal();
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
      Eigen::Vector3d::Constant(kArm);
}

void StepDetector::begin(State& state, const BodyMotion& motion) {
  if (state.carried().cols() != kColumns) state.carry(kColumns);
  for (int m = 0; m <= kMoments; ++m) begin(state, motion, m);
  next_us_ = 0;
  usual_ = 1.0;
  fresh_ = false;
  watches_ = true;
}

/// An imu's clock that is set forward by d leaves a gap of d in its stamps, over which the state is moved once too often, and
/// one that is set back leaves out as much, (N.5.9).
void StepDetector::begin(State& state, const BodyMotion& motion, int moment) {
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
  information_[static_cast<size_t>(moment)].setZero();
  sum_.col(moment).setZero();
  age_(moment) = squares_(moment) = count_(moment) = 0.0;
}

void StepDetector::begin_latest(State& state, const BodyMotion& motion) {
  latest_ = 1 - latest_;
  latest_us_ = state.x.t_us;
  begin(state, motion, latest_);
}

void StepDetector::begin_at_surprise(State& state, const BodyMotion& motion, double whitened_square, int rows) {
  const int64_t t_us = state.x.t_us;
  if (!watches_ || whitened_square < kMostSquare + rows) return;
  if (t_us < surprised_us_ + kFirst_us && whitened_square < kMoreOf * surprise_) return;
  surprised_us_ = t_us;
  surprise_ = whitened_square;
  begin_latest(state, motion);
}

/// Two moments per octave: the first two take turns every second, the next two every two seconds, ... The others take
/// turns every time.
void StepDetector::advance(State& state, const BodyMotion& motion, bool displaced) {
  const int64_t t_us = state.x.t_us;
  if (!watches_ || t_us < next_us_) return;
  if (displaced) begin(state, motion, kStart);
  next_us_ = t_us + kApart_us;
  ++turn_;
  begin(state, motion, kOctaves + turn_ % (kMoments - kOctaves));
  if (t_us >= latest_us_ + kFirst_us) begin_latest(state, motion);
  for (int octave = 1; octave < kOctaves / 2; ++octave) {
    const int period = kFirst_us / kApart_us << octave;
    if (turn_ % period != 0) break;
    begin(state, motion, 2 * octave + (turn_ / period) % 2);
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
  const double weight = std::min(1.0, kMostSquare * rows / square);
  for (int m = 0; m <= (antenna ? kStart : kStart - 1); ++m) {
    const int n = width(m);
    const auto g = G.middleCols(first(m), n);
    information_[static_cast<size_t>(m)].topLeftCorner(n, n) += weight * g.transpose().lazyProduct(g);
    sum_.col(m).head(n) += weight * g.transpose().lazyProduct(whitened);
    squares_(m) += weight * square - rows;
    count_(m) += 1.0;
  }
  fresh_ = true;
}

bool StepDetector::carries(int moment, int at, int size) const {
  return at < kWidth ? moment < kStart && at + size <= width(moment) : moment == kStart;
}

StepDetector::Fit StepDetector::best_of(int at, int size) const {
  const double usual = std::max(1.0, usual_);
  const int column = column_of(at);
  Fit best;
  for (int m = 0; m <= kMoments; ++m) {
    if (count_(m) < kLeastEvidence || !carries(m, at, size)) continue;
    const Posterior fit(information_[static_cast<size_t>(m)].block(column, column, size, size) / usual,
                        sum_.col(m).segment(column, size) / usual, typical_.segment(at, size));
    if (fit.explained * usual < kMostOfIt * squares_(m)) continue;
    if (fit.log_odds > best.log_odds) best = {m, fit.log_odds};
  }
  return best;
}

std::optional<StepDetector::Step> StepDetector::most_likely(double sigmas, bool displaced) const {
  if (!watches_) return std::nullopt;
  std::array<Fit, kBlocks.size()> fits;
  size_t best = 0;
  for (size_t k = 0; k < kBlocks.size(); ++k) {
    if (displaced && (kBlocks[k].kind == StepKind::kReceiver || kBlocks[k].kind == StepKind::kLeverArm)) continue;
    fits[k] = best_of(kBlocks[k].first, kBlocks[k].size);
    fits[k].log_odds -= kBlocks[k].rarity;
    if (fits[k].log_odds > fits[best].log_odds) best = k;
  }
  if (fits[best].log_odds < 0.5 * sigmas * sigmas) return std::nullopt;
  for (size_t k = 0; k < kBlocks.size(); ++k)
    if (kBlocks[k].kind != kBlocks[best].kind && fits[best].log_odds < fits[k].log_odds + kBeyondOthers)
      return std::nullopt;
  const auto [kind, at, size, rarity] = kBlocks[best];
  const int m = fits[best].moment;
  const double usual = std::max(1.0, usual_);
  const int column = column_of(at);
  const Posterior fit(information_[static_cast<size_t>(m)].block(column, column, size, size) / usual,
                      sum_.col(m).segment(column, size) / usual, typical_.segment(at, size));
  return Step{kind, fit.log_odds - rarity, first(m) + column, fit.mean, fit.cov};
}

std::optional<StepDetector::Doubt> StepDetector::doubted(const Step& step, int64_t t_us) const {
  if (step.kind != StepKind::kReceiver || !clock_stepped_lately(t_us)) return std::nullopt;
  int oldest = 0;
  age_.head<kRecent>().maxCoeff(&oldest);
  return Doubt{first(oldest) + kReceiverClock, clock_step_};
}

bool StepDetector::clock_stepped_lately(int64_t t_us) const {
  return clock_step_us_ != 0 && seconds_between(clock_step_us_, t_us) < kMemory;
}

void StepDetector::take_back(const Step& step, State& state, const BodyMotion& motion) {
  const int n = state.size();
  const auto per_unit = state.carried().middleCols(step.column, step.size.size()).topRows(n);
  ErrorVector d = per_unit * step.size;
  state.retract(d);
  const auto widen = [&] {
    for (int j = 0; j < n; ++j) state.P().col(j).head(n) += d(j) * d;
  };
  const Small root = step.cov.llt().matrixL();
  for (int k = 0; k < root.cols(); ++k) {
    d = per_unit * root.col(k);
    widen();
  }
  if (const auto doubt = doubted(step, state.x.t_us)) {
    d = doubt->size * state.carried().col(doubt->column).head(n);
    widen();
  }
  note_clock(step, state.x.t_us);
  begin(state, motion);
}

void StepDetector::note_clock(const Step& step, int64_t t_us) {
  if (step.kind == StepKind::kReceiverClock) {
    clock_step_ = (clock_stepped_lately(t_us) ? clock_step_ : 0.0) + step.size(0);
    clock_step_us_ = t_us;
  }
  if (step.kind == StepKind::kReceiver) clock_step_us_ = 0;
}

}  // namespace roadfix::navigation
