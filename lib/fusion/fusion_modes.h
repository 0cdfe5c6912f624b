/// The fusion's updates of all modes by one measurement. For fusion_*.cpp alone.
#pragma once

#include "fusion/fusion.h"

namespace roadfix {

template <int M>
void Fusion::add(Mean<M>& mean, double share, const FusionInnovation<M>& innovation,
                 const Eigen::Matrix<double, M, 1>& difference) {
  mean.innovation.nis += share * innovation.nis;
  mean.innovation.variance += share * innovation.variance;
  mean.difference += share * difference;
}

template <int M, class At>
Fusion::Mean<M> Fusion::update(const At& at) {
  Mean<M> mean;
  for (std::size_t i = 0; i < kModes; ++i) {
    Mode& mode = imm_.modes[i];
    const FusionMeasurement<M> m = at(mode.estimate.x);
    const FusionInnovation<M> innovation = kalman_update<M>(mode.estimate, m.H, m.innovation, m.R);
    mode.log_likelihood += innovation.log_likelihood;
    add(mean, imm_.probability(static_cast<Eigen::Index>(i)), innovation, m.innovation);
  }
  return mean;
}

}  // namespace roadfix
