/// Has something jumped, and when? Generalised likelihood ratio test (Willsky and Jones 1976) over a list of states that
/// may step: for some moments it carries what a step of one unit then would have made of the filter's errors since, and
/// how well that explains the innovations, (N.5.8) to (N.5.10) of MODEL.md.
///
/// What a step would have made of the errors are the columns that the state carries (State::carried()), so poses of the
/// camera have their rows too.
#pragma once

#include <array>
#include <optional>

#include "navigation/state.h"

namespace roadfix::navigation {

class StepDetector {
 public:
  static constexpr int kHypotheses = 1;
  /// The wheels' scale. A state is added by its index here.
  static constexpr std::array<int, kHypotheses> kSteps = {kWheelScale};
  static constexpr int kMoments = 8;
  static constexpr int kColumns = kHypotheses * kMoments;

  struct Step {
    int state = 0;                      ///< which stepped
    double size = 0.0, variance = 0.0;  ///< in the state's unit
    int column = 0;                     ///< carried column: errors of the filter now per unit of the step
  };

  /// Watches from now on.
  void begin(State& state);
  void stop() { watches_ = false; }
  [[nodiscard]] bool watches() const { return watches_; }
  /// At t_us, often: the oldest of the recent moments are replaced by now.
  void advance(State& state);

  /// The filter's covariance step.
  void move(State& state, const Eigen::Matrix<double, 9, kInertialSize>& F,
            const Eigen::Matrix<double, kWithoutCamera, 1>& decay);
  /// The filter's update: `whitened` innovation u = L^-1 r, Y = P H' L^-T; `counts`: it is evidence.
  template <int Rows>
  void use(State& state, const Eigen::Matrix<double, Rows, kWithoutCamera>& H,
           const Eigen::Matrix<double, Rows, Rows>& L, const Eigen::Matrix<double, Rows, 1>& whitened,
           const Eigen::Ref<const Eigen::MatrixXd>& Y, bool counts) {
    if (!watches_) return;
    auto errors = state.carried().topRows(state.size());
    Eigen::Matrix<double, Rows, kColumns> G = H.lazyProduct(errors.template topRows<kWithoutCamera>());
    L.template triangularView<Eigen::Lower>().solveInPlace(G);
    errors.noalias() -= Y.lazyProduct(G);
    if (!counts) return;
    const double squares = whitened.squaredNorm();
    usual_ += kUsualGain * (std::min(squares / Rows, kMostSquare) - usual_);
    for (int k = 0; k < kColumns; ++k) {
      information_(k) += G.col(k).squaredNorm();
      sum_(k) += G.col(k).dot(whitened);
      squares_(k) += squares - Rows;
    }
  }

  /// The step that explains most, unless chance does at this many sigmas, or something else makes the innovations large.
  [[nodiscard]] std::optional<Step> most_likely(double sigmas) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(watches_, next_us_, turn_, usual_, information_, sum_, squares_);
  }

 private:
  static constexpr double kUsualGain = 0.01;  // ten seconds of wheel speeds
  static constexpr double kMostSquare = 9.0;  // one innovation counts at most as three sigma
  void begin(State& state, int column);

  bool watches_ = false;
  int64_t next_us_ = 0;
  int turn_ = 0;
  double usual_ = 1.0;  ///< mean normalised square: measurements may be noisier than they claim
  using PerColumn = Eigen::Matrix<double, kColumns, 1>;
  PerColumn information_ = PerColumn::Zero(), sum_ = PerColumn::Zero(), squares_ = PerColumn::Zero();
};

}  // namespace roadfix::navigation
