/// The chi-square distribution: what NEES, NIS and gates are measured against.
#pragma once

namespace roadfix {

/// P(X <= x) for X chi-square with dof degrees of freedom (any real dof > 0).
double chi_square_cdf(double x, double dof);

/// P(X > x), accurate far into the tail.
double chi_square_tail(double x, double dof);

/// The x with chi_square_cdf(x, dof) == probability, probability in (0, 1).
double chi_square_quantile(double probability, double dof);

/// The quantile of the standard normal distribution.
double normal_quantile(double probability);

}  // namespace roadfix
