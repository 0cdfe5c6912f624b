/// Seeded numbers for the fusion's tests.
#pragma once

#include "fusion/motion_model.h"
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
  e.x = draws.vector<fusion::kSize>(1.0);
  e.x(fusion::kSpeed) = 10.0 + draws.normal(3.0);
  fusion::Matrix A;
  for (int i = 0; i < fusion::kSize; ++i) A.col(i) = draws.vector<fusion::kSize>(0.2);
  e.P = A * A.transpose();
  return e;
}

}  // namespace roadfix::test
