/// Linear measurements with unit noise, and the Kalman update by any number of them, (N.3.2).
#pragma once

#include <array>
#include <span>

#include "navigation/state.h"

namespace roadfix::navigation {

/// Columns of the state that a stack of rows depends on: the camera, every clone and every point.
class Columns {
 public:
  static constexpr int kCamera = 15;  ///< turn, place, lens, right eye's turn, drift
  static constexpr int kMost = kCamera + 6 * kMaxClones + 3 * kMaxPoints;

  explicit Columns(const State& state);
  [[nodiscard]] int size() const { return size_; }
  /// First column of the clone with this index in state.clones.
  [[nodiscard]] static int of_clone(size_t index) { return kCamera + 6 * static_cast<int>(index); }
  [[nodiscard]] std::span<const StateBlock> blocks() const { return {blocks_.data(), count_}; }

 private:
  void add(const StateBlock& block);

  std::array<StateBlock, kMaxClones + kMaxPoints + 1> blocks_{};
  size_t count_ = 0;
  int size_ = 0;
};

/// Collects rows and applies them at once; its memory is taken once.
class Update {
 public:
  static constexpr int kMaxRows = Columns::kMost;  ///< what tracks are compressed to

  Update();
  void begin(const State& state);
  [[nodiscard]] int rows() const { return rows_; }
  /// `stack` = [H | r], H over these columns; at most kMaxRows rows.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& stack, const Columns& columns);
  /// False, and nothing changed, where the innovation covariance is not positive definite.
  [[nodiscard]] bool apply(State& state);

 private:
  int rows_ = 0, size_ = 0;
  Eigen::MatrixXd H_, PHt_, S_, G_;
  Eigen::VectorXd r_, d_;
};

}  // namespace roadfix::navigation
