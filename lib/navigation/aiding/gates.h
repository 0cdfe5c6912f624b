/// Chi-square gates by degrees of freedom, 1 to 3.
#pragma once

#include <array>
#include <cmath>

#include "statistics/chi_square.h"

namespace roadfix::navigation {

struct Gates {
  std::array<double, 4> nis{};

  /// At as many Gaussian standard deviations.
  explicit Gates(double sigma) {
    const double tail = std::erfc(sigma / std::sqrt(2.0));
    for (int dof = 1; dof <= 3; ++dof) nis[static_cast<size_t>(dof)] = chi_square_quantile(1.0 - tail, dof);
  }
  /// Passes everything: for hypotheses that are weighed by their likelihood.
  static Gates open() {
    Gates g;
    g.nis.fill(1e12);
    return g;
  }

 private:
  Gates() = default;
};

}  // namespace roadfix::navigation
