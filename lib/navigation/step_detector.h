/// Has something jumped, what, and when? Generalised likelihood ratio test (Willsky and Jones 1976) over a list of
/// things that may step: for some moments it carries what a step of one unit then would have made of the filter's errors
/// since, and how well that explains the innovations, of rejected measurements too, (N.5.8) to (N.5.11) of MODEL.md.
///
/// What a step would have made of the errors are the columns that the state carries (State::carried()), so poses of the
/// camera have their rows too.
#pragma once

#include <array>
#include <optional>
#include <utility>

#include "navigation/body_motion.h"
#include "navigation/config.h"
#include "navigation/state.h"
#include "statistics/chance.h"

namespace roadfix::navigation {

enum class StepKind {
  kWheels,    ///< their scale
  kImu,       ///< gyro and accelerometer biases
  kReceiver,  ///< its position is displaced, and may be dragged on from there
  kImuClock,
  kReceiverClock,
  kWheelClock,
  kLeverArm,  ///< no step: the antenna has never been where the calibration says
  kNone,      ///< what was taken back last had not stepped
};

class StepDetector {
 public:
  /// Moments two per octave of the past, 1 to 16 s, and two that began where an innovation surprised. Of the recent ones all
  /// kinds are carried that jump, of the others the wheels' scale alone.
  static constexpr int kOctaves = 4, kSurprises = 4, kRecent = kSurprises + 2;
  static constexpr int of_octave(int octave) { return 2 * octave < kSurprises ? 2 * octave : 2 * octave + 2; }
  /// Of the last eight seconds one moment every half second, with the wheels' scale alone: in a second the filter takes
  /// most of its step for the car's speed.
  static constexpr int kRing = 2 * kOctaves + 2, kMoments = kRing + 16;
  /// The moment from which on the filter watches: the antenna's place, which was wrong from the start if it is.
  static constexpr int kStart = kMoments;
  static constexpr int kAntennaSize = 3;
  /// The moment at which a step was taken back last.
  static constexpr int kTaken = kStart + 1;
  /// Columns of a moment: wheel scale, gyro and accelerometer biases, displacement, its rate, three clocks.
  static constexpr int kWidth = 16;
  static constexpr int kColumns = kRecent * kWidth + kMoments - kRecent + kAntennaSize + 1;
  static constexpr int width(int moment) {
    if (moment < kRecent) return kWidth;
    return moment == kStart ? kAntennaSize : 1;
  }
  static constexpr int first(int moment) {
    if (moment < kRecent) return moment * kWidth;
    return moment < kTaken ? kRecent * kWidth + moment - kRecent : kColumns - 1;
  }
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
  using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;

  struct Step {
    StepKind kind = StepKind::kWheels;
    double log_odds = 0.0;  ///< against none
    double age = 0.0;       ///< s since it happened
    int column = 0;         ///< first of the carried columns: errors of the filter now per unit of the step
    SmallVector size;       ///< in the units of the columns
    Small cov;
  };

  explicit StepDetector(const VehicleFacts& facts);

  /// Watches from now on.
  void begin(State& state, const BodyMotion& motion);
  /// What came in the last `seconds` is explained: watches anew, and knows of the antenna's place what it knew before.
  void begin_after(State& state, const BodyMotion& motion, double seconds);
  void stop() { watches_ = false; }
  /// Often: the oldest moments are replaced by now. `displaced`: the receiver is known to be, and what it says
  /// tells nothing of where its antenna is.
  void advance(State& state, const BodyMotion& motion, bool displaced);

  /// Before use() or reject() of an innovation of `rows` rows: where one surprises a moment begins, but not at those that go on
  /// surprising as much: by a moment half a second beside it a step is found late.
  void begin_at_surprise(State& state, const BodyMotion& motion, double whitened_square, int rows);

  /// The filter's covariance step over T s.
  void move(State& state, const Eigen::Matrix<double, 9, kInertialSize>& F,
            const Eigen::Matrix<double, kWithoutCamera, 1>& decay, double T);
  /// The filter's update: `whitened` innovation u = L^-1 r, Y = P H' L^-T; `counts`: it is evidence; `antenna`: of the
  /// antenna's place too.
  template <int Rows>
  void use(State& state, const Eigen::Matrix<double, Rows, kWithoutCamera>& H,
           const Eigen::Matrix<double, Rows, Rows>& L, const Eigen::Matrix<double, Rows, 1>& whitened,
           const Eigen::Ref<const Eigen::MatrixXd>& Y, bool counts, bool antenna) {
    if (!watches_) return;
    auto G = explained(state, H, L);
    state.carried().topRows(state.size()).noalias() -= Y.lazyProduct(G);
    if (!counts) return;
    usual_ += kUsualGain * (std::min(whitened.squaredNorm() / Rows, kChance * kChance) - usual_);
    weigh(G, whitened, antenna);
  }
  /// A measurement that the filter rejected.
  template <int Rows>
  void reject(const State& state, const Eigen::Matrix<double, Rows, kWithoutCamera>& H,
              const Eigen::Matrix<double, Rows, Rows>& L, const Eigen::Matrix<double, Rows, 1>& whitened,
              bool antenna) {
    if (watches_) weigh(explained(state, H, L), whitened, antenna);
  }

  /// The step that explains most, unless chance does at this many sigmas, something else makes the innovations large, or
  /// another kind explains as much. `displaced`: the receiver is known to be: its steps are the filter's to follow, and
  /// its antenna is asked for no place. `receiver_waits`: how it is wrong may
  /// show yet, and its steps wait.
  [[nodiscard]] std::optional<Step> most_likely(double sigmas, bool displaced, bool receiver_waits) const;
  /// Takes `step` back: what it has made of all errors goes out of the means, how well it is known into the covariance, whose
  /// epoch is the state's; the one before is doubted where it was of another kind, (N.5.11). Watches anew, but what was known
  /// of the antenna's place before the step is known still.
  void take_back(const Step& step, State& state, const BodyMotion& motion);

  /// Evidence has come since the last call.
  [[nodiscard]] bool take_fresh() { return std::exchange(fresh_, false); }

  template <class Archive>
  void serialise(Archive& a) {
    a(watches_, fresh_, displaced_, next_us_, turn_, latest_, surprised_us_, surprise_, usual_, age_, sum_, squares_,
      count_, last_kind_, last_us_);
    for (int m = 0; m <= kTaken; ++m) serialise(a, information_[static_cast<size_t>(m)], width(m));
    for (OfAntenna& b : before_) a(b.information, b.sum, b.squares, b.count);
  }

 private:
  static constexpr double kUsualGain = 0.01;  // ten seconds of wheel speeds
  using Square = Eigen::Matrix<double, kWidth, kWidth>;
  template <class Archive>
  static void serialise(Archive& a, Square& information, int size) {
    for (int k = 0; k < size; ++k)
      for (int i = 0; i < size; ++i) a(information(i, k));
  }
  /// What of a whitened innovation each step makes; in place, so that nothing of a fixed size is unrolled.
  using Rows = Eigen::Block<Eigen::MatrixXd>;
  Rows explained(const State& state, const Eigen::Ref<const Eigen::MatrixXd>& H,
                 const Eigen::Ref<const Eigen::MatrixXd>& L);
  void weigh(const Eigen::Ref<const Eigen::MatrixXd>& G, const Eigen::Ref<const Eigen::VectorXd>& whitened,
             bool antenna);
  struct Fit {
    double likelihood = 0.0;  ///< logarithm of its ratio to that of no step
    Step step;                ///< of the moment that explains most
  };
  void begin(State& state, const BodyMotion& motion, int moment);
  void begin_columns(State& state, const BodyMotion& motion, int moment) const;
  /// Evidence on the antenna's place.
  struct OfAntenna {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double squares = 0.0, count = 0.0;
  };
  [[nodiscard]] Fit best_of(size_t block) const;
  [[nodiscard]] bool carries(int moment, int at, int size) const;
  /// A step was taken back lately, and another may have been the cause.
  [[nodiscard]] bool doubts_last() const;

  /// Standard deviations of steps, in the order of a moment's columns; then those of the antenna's place, and the share of
  /// what was taken back.
  Eigen::Matrix<double, kWidth + kAntennaSize + 1, 1> typical_;
  Eigen::MatrixXd explained_ = Eigen::MatrixXd::Zero(3, kColumns), moved_ = Eigen::MatrixXd::Zero(9, kColumns);
  bool watches_ = false, fresh_ = false;
  bool displaced_ = false;  ///< the receiver is known to be
  int64_t next_us_ = 0;
  int turn_ = 0, latest_ = 0;  ///< latest_: of the two surprises
  int64_t surprised_us_ = 0;
  double surprise_ = 0.0;                   ///< square of the whitened innovation at which a moment began last
  StepKind last_kind_ = StepKind::kWheels;  ///< of what was taken back last
  int64_t last_us_ = 0;                     ///< when; 0: nothing, or nothing to doubt
  double usual_ = 1.0;                      ///< mean normalised square: measurements may be noisier than they claim
  std::array<Square, kTaken + 1> information_ = [] {
    std::array<Square, kTaken + 1> zero;
    zero.fill(Square::Zero());
    return zero;
  }();
  Eigen::Matrix<double, kWidth, kTaken + 1> sum_ = Eigen::Matrix<double, kWidth, kTaken + 1>::Zero();
  /// By moment: s since; of the innovations beyond their number; evidence.
  using ByMoment = Eigen::Matrix<double, kTaken + 1, 1>;
  ByMoment age_ = ByMoment::Zero(), squares_ = ByMoment::Zero(), count_ = ByMoment::Zero();
  std::array<OfAntenna, kMoments> before_;  ///< as it was when the moment began
};

}  // namespace roadfix::navigation
