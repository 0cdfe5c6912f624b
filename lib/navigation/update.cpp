#include "navigation/update.h"

namespace roadfix::navigation {

Columns::Columns(const State& state) {
  add({kCameraTurn, kCamera});
  for (const Clone& c : state.clones) add({c.at, 6});
  for (const Point& p : state.points) add({p.at, 3});
}

void Columns::add(const StateBlock& block) {
  blocks_[count_++] = block;
  size_ += block.width;
}

Update::Update()
    : H_(kMaxRows, kMaxSize), PHt_(kMaxSize, kMaxRows), S_(kMaxRows, kMaxRows), r_(kMaxRows), d_(kMaxSize) {}

void Update::begin(const State& state) {
  rows_ = 0;
  size_ = state.size();
  H_.setZero();
}

void Update::add(const Eigen::Ref<const Eigen::MatrixXd>& stack, const Columns& columns) {
  const auto count = static_cast<int>(stack.rows());
  int column = 0;
  for (const auto& [at, width] : columns.blocks()) {
    H_.block(rows_, at, count, width) = stack.middleCols(column, width);
    column += width;
  }
  r_.segment(rows_, count) = stack.col(column);
  rows_ += count;
}

bool Update::apply(State& state) {
  if (rows_ == 0) return true;
  const auto P = state.P().topLeftCorner(size_, size_);
  const auto H = H_.topLeftCorner(rows_, size_);
  auto PHt = PHt_.topLeftCorner(size_, rows_);
  auto S = S_.topLeftCorner(rows_, rows_);
  PHt.noalias() = P * H.transpose();
  S.noalias() = H * PHt;
  S.diagonal().array() += 1.0;
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
  if (llt.info() != Eigen::Success) return false;
  llt.matrixU().solveInPlace<Eigen::OnTheRight>(PHt);
  auto r = r_.head(rows_);
  llt.matrixL().solveInPlace(r);
  d_.head(size_).noalias() = PHt * r;
  if (const auto columns = state.carried().cols(); columns > 0) {
    auto carried = state.carried().topRows(size_);
    G_.resize(rows_, columns);
    G_.noalias() = H * carried;
    llt.matrixL().solveInPlace(G_);
    carried.noalias() -= PHt * G_;
  }
  state.subtract(PHt);
  state.correct(d_);
  return true;
}

}  // namespace roadfix::navigation
