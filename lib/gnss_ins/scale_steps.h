/// Has the wheels' scale stepped, and when? For some moments it is followed what a step then would have made of the
/// filter's errors since, and how well that explains the innovations (Willsky and Jones 1976), (M.50).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "gnss_ins/covariance_step.h"

namespace roadfix {

class ScaleSteps {
 public:
  /// What a step at one moment is by now.
  struct Since {
    ErrorVector per_unit = ErrorVector::Zero();  ///< errors of the filter per unit of the step
    double information = 0.0;
    double sum = 0.0;      ///< the step times its information
    double squares = 0.0;  ///< of all innovations, normalised
    int rows = 0;
    [[nodiscard]] double size() const { return sum / information; }
  };

  /// Follows steps from now on.
  void begin() {
    for (Since& s : since_) begin(s);
    next_us_ = 0;
    follows_ = true;
  }
  [[nodiscard]] bool follows() const { return follows_; }
  /// To be called often: moments are forgotten for newer ones, the older the more seldom.
  void advance(int64_t t_us);

  /// The filter's transition.
  void move(const Transition& phi);
  /// What is measured while the car is slow tells nothing of a scale, and the noise of speeds without a sign is
  /// rectified there.
  enum class By { kSlow, kWheels, kOther };
  /// The filter's update: explain(per_unit) is what a step per unit adds to the whitened innovation, and leaves in
  /// `per_unit` what the update leaves.
  template <int Rows, class Explain>
  void use(const Eigen::Matrix<double, Rows, 1>& whitened, By by, const Explain& explain) {
    const double squares = whitened.squaredNorm();
    if (by == By::kWheels) usual_ += kGain * (std::min(squares, kMostSquare) - usual_);
    for (Since& s : since_) {
      const Eigen::Matrix<double, Rows, 1> signature = explain(s.per_unit);
      if (by == By::kSlow) continue;
      s.information += signature.squaredNorm();
      s.sum += signature.dot(whitened);
      s.squares += squares;
      s.rows += Rows;
    }
  }

  /// The step that explains most, unless chance does at this many sigmas, or something else makes the innovations
  /// large.
  [[nodiscard]] std::optional<Since> most_likely(double sigmas) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(follows_, next_us_, turn_, usual_);
    for (Since& s : since_) a(s.per_unit, s.information, s.sum, s.squares, s.rows);
  }

 private:
  static constexpr int kOctaves = 5;
  static constexpr double kGain = 0.01;       // ten seconds of speeds
  static constexpr double kMostSquare = 9.0;  // one speed counts at most as three sigma
  static void begin(Since& s);

  bool follows_ = false;
  int64_t next_us_ = 0;
  int turn_ = 0;
  /// Mean normalised square of the wheels' innovations: they may be noisier than they are said to be.
  double usual_ = 1.0;
  std::array<Since, 2 * kOctaves> since_{};
};

}  // namespace roadfix
