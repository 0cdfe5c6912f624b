/// Linear measurements with unit noise, and the Kalman update by any number of them, (N.3.2).
#pragma once

#include <array>
#include <span>

#include "navigation/state.h"

namespace roadfix::navigation {

/// A few rows: r = sum of H_k d(at_k) + noise of unit covariance.
class Linear {
 public:
  static constexpr int kMaxRows = 6;
  static constexpr int kMaxColumns = 32;

  explicit Linear(int rows) : rows_(rows) {}
  template <class Derived>
  void residual(const Eigen::MatrixBase<Derived>& r) {
    if constexpr (Derived::RowsAtCompileTime != Eigen::Dynamic) {
      r_.template head<Derived::RowsAtCompileTime>() = r;
    } else {
      r_.head(rows_) = r;
    }
  }
  template <class Derived>
  void block(int at, const Eigen::MatrixBase<Derived>& H) {
    const auto width = static_cast<int>(H.cols());
    at_[static_cast<size_t>(blocks_)] = at;
    width_[static_cast<size_t>(blocks_++)] = width;
    if constexpr (Derived::SizeAtCompileTime != Eigen::Dynamic) {
      H_.template block<Derived::RowsAtCompileTime, Derived::ColsAtCompileTime>(0, columns_) = H;
    } else {
      H_.block(0, columns_, rows_, width) = H;
    }
    columns_ += width;
  }
  /// Divides each row by its standard deviation.
  template <class Derived>
  void whiten(const Eigen::MatrixBase<Derived>& std) {
    for (int i = 0; i < rows_; ++i) {
      H_.row(i).head(columns_) /= std(i);
      r_(i) /= std(i);
    }
  }

  /// Takes out of the residual what the state expects of its own errors.
  void expect(const State& state);

  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] int blocks() const { return blocks_; }
  [[nodiscard]] int at(int k) const { return at_[static_cast<size_t>(k)]; }
  [[nodiscard]] int width(int k) const { return width_[static_cast<size_t>(k)]; }
  [[nodiscard]] auto r() const { return r_.head(rows_); }
  [[nodiscard]] auto H() const { return H_.topLeftCorner(rows_, columns_); }
  /// r' (H P H' + I)^-1 r.
  [[nodiscard]] double nis(const State& state) const;

 private:
  int rows_, columns_ = 0, blocks_ = 0;
  std::array<int, 12> at_{}, width_{};
  Eigen::Matrix<double, kMaxRows, kMaxColumns> H_;
  Eigen::Matrix<double, kMaxRows, 1> r_;
};

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
  void add(const Linear& rows);
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
