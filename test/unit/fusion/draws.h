/// Seeded numbers for the fusion's tests.
#pragma once

#include "fusion/fusion_state.h"
#include "simulation/random.h"

namespace roadfix::test {

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : stream_(seed, 1) {}
  double normal(double sigma) { return sigma * stream_.normal(); }
  template <int N>
  Eigen::Matrix<double, N, 1> vector(double sigma) {
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) v(i) = normal(sigma);
    return v;
  }

 private:
  RandomStream stream_;
};

inline FusionEstimate random_estimate(Draws& draws) {
  FusionEstimate e;
  e.x.head<fusion::kStates>() = draws.vector<fusion::kStates>(1.0);
  e.x(fusion::kSpeed) = 10.0 + draws.normal(3.0);
  for (const int i : {int{fusion::kVoScale}, int{fusion::kWheelScale}}) e.x(i) = draws.normal(0.05);
  e.x(fusion::kVoTurns) = draws.normal(0.05);
  fusion::StatesCovariance A;
  for (int i = 0; i < fusion::kStates; ++i) A.col(i) = draws.vector<fusion::kStates>(0.2);
  e.P.topLeftCorner<fusion::kStates, fusion::kStates>() = A * A.transpose();
  return e;
}

}  // namespace roadfix::test
