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

namespace roadfix::navigation {

enum class StepKind {
  kWheels,    ///< their scale
  kImu,       ///< gyro and accelerometer biases
  kReceiver,  ///< its position is displaced, and may be dragged on from there
  kImuClock,
  kReceiverClock,
  kWheelClock,
  kLeverArm,  ///< no step: the antenna has never been where the calibration says
};

class StepDetector {
 public:
  /// Moments two per octave of the past: of the recent ones all kinds are carried that jump, of the others the wheels'
  /// scale alone.
  static constexpr int kRecent = 4, kOctaves = 8;
  /// Of the last eight seconds one moment every half second, with the wheels' scale alone: in a second the filter takes
  /// most of its step for the car's speed.
  static constexpr int kMoments = kOctaves + 16;
  /// The moment from which on the filter watches: the antenna's place, which was wrong from the start if it is.
  static constexpr int kStart = kMoments;
  static constexpr int kAntennaSize = 3;
  /// Columns of a moment: wheel scale, gyro and accelerometer biases, displacement, its rate, three clocks.
  static constexpr int kWidth = 16;
  static constexpr int kColumns = kRecent * kWidth + kMoments - kRecent + kAntennaSize;
  static constexpr int width(int moment) { return moment < kRecent ? kWidth : moment < kStart ? 1 : kAntennaSize; }
  static constexpr int first(int moment) {
    return moment < kRecent ? moment * kWidth : kRecent * kWidth + moment - kRecent;
  }
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
  using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;

  struct Step {
    StepKind kind = StepKind::kWheels;
    double log_odds = 0.0;  ///< against none
    int column = 0;         ///< first of the carried columns: errors of the filter now per unit of the step
    SmallVector size;       ///< in the units of the columns
    Small cov;
  };

  explicit StepDetector(const VehicleFacts& facts);

  /// Watches from now on.
  void begin(State& state, const BodyMotion& motion);
  void stop() { watches_ = false; }
  [[nodiscard]] bool watches() const { return watches_; }
  /// Often: the oldest moments are replaced by now. `displaced`: the receiver is known to be, and what it says
  /// tells nothing of where its antenna is.
  void advance(State& state, const BodyMotion& motion, bool displaced);

  /// Before use() or reject() of an innovation of `rows` rows: where one surprises a moment begins, at most once a second but
  /// for larger ones: by a moment half a second beside it a step is found late.
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
    usual_ += kUsualGain * (std::min(whitened.squaredNorm() / Rows, kMostSquare) - usual_);
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
  /// its antenna is asked for no place.
  [[nodiscard]] std::optional<Step> most_likely(double sigmas, bool displaced) const;
  /// Takes `step` back: what it has made of all errors goes out of the means, how well it is known into the covariance, whose
  /// epoch is the state's. Watches anew.
  void take_back(const Step& step, State& state, const BodyMotion& motion);

  /// Evidence has come since the last call.
  [[nodiscard]] bool take_fresh() { return std::exchange(fresh_, false); }

  template <class Archive>
  void serialise(Archive& a) {
    a(watches_, fresh_, next_us_, turn_, latest_, latest_us_, surprised_us_, surprise_, usual_, age_, sum_, squares_,
      count_, clock_step_, clock_step_us_);
    for (auto& m : information_) a(m);
  }

 private:
  static constexpr double kUsualGain = 0.01;  // ten seconds of wheel speeds
  static constexpr double kMostSquare = 9.0;  // one innovation counts at most as three sigma
  using Square = Eigen::Matrix<double, kWidth, kWidth>;
  /// What of a whitened innovation each step makes; in place, so that nothing of a fixed size is unrolled.
  using Rows = Eigen::Block<Eigen::MatrixXd>;
  Rows explained(const State& state, const Eigen::Ref<const Eigen::MatrixXd>& H,
                 const Eigen::Ref<const Eigen::MatrixXd>& L);
  void weigh(const Eigen::Ref<const Eigen::MatrixXd>& G, const Eigen::Ref<const Eigen::VectorXd>& whitened,
             bool antenna);
  struct Fit {
    int moment = 0;
    double log_odds = 0.0;
  };
  void begin(State& state, const BodyMotion& motion, int moment);
  /// The older of the first two moments.
  void begin_latest(State& state, const BodyMotion& motion);
  void note_clock(const Step& step, int64_t t_us);
  [[nodiscard]] Fit best_of(int at, int size) const;
  [[nodiscard]] bool carries(int moment, int at, int size) const;
  [[nodiscard]] bool clock_stepped_lately(int64_t t_us) const;
  /// (N.5.11): a receiver that is dragged off along the way looks like its clock at first. Where `step` shows it
  /// displaced: the column of that clock, and the sum of its steps of the last 16 s, s.
  struct Doubt {
    int column = 0;
    double size = 0.0;
  };
  [[nodiscard]] std::optional<Doubt> doubted(const Step& step, int64_t t_us) const;

  /// Standard deviations of steps, in the order of a moment's columns; then those of the antenna's place.
  Eigen::Matrix<double, kWidth + kAntennaSize, 1> typical_;
  Eigen::MatrixXd explained_ = Eigen::MatrixXd::Zero(3, kColumns), moved_ = Eigen::MatrixXd::Zero(9, kColumns);
  bool watches_ = false, fresh_ = false;
  int64_t next_us_ = 0;
  int turn_ = 0, latest_ = 0;  ///< latest_: of the first two moments
  int64_t latest_us_ = 0, surprised_us_ = 0;
  double surprise_ = 0.0;      ///< square of the whitened innovation at which a moment began last
  double clock_step_ = 0.0;    ///< s, of the receiver's clock, as of doubted()
  int64_t clock_step_us_ = 0;  ///< of the last of them; 0: none
  double usual_ = 1.0;         ///< mean normalised square: measurements may be noisier than they claim
  std::array<Square, kMoments + 1> information_ = [] {
    std::array<Square, kMoments + 1> zero;
    zero.fill(Square::Zero());
    return zero;
  }();
  Eigen::Matrix<double, kWidth, kMoments + 1> sum_ = Eigen::Matrix<double, kWidth, kMoments + 1>::Zero();
  /// By moment: s since; of the innovations beyond their number; evidence.
  using ByMoment = Eigen::Matrix<double, kMoments + 1, 1>;
  ByMoment age_ = ByMoment::Zero(), squares_ = ByMoment::Zero(), count_ = ByMoment::Zero();
};

}  // namespace roadfix::navigation
