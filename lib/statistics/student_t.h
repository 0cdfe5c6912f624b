/// Student's t distribution: what the mean of a few differences is measured against.
#pragma once

namespace roadfix {

/// P(T <= t) for T with dof degrees of freedom (any real dof > 0).
double student_t_cdf(double t, double dof);

/// The t with student_t_cdf(t, dof) == probability, probability in (0, 1).
double student_t_quantile(double probability, double dof);

/// I_x(a, b), the regularised incomplete beta function; a, b > 0, x in [0, 1].
double incomplete_beta(double x, double a, double b);

}  // namespace roadfix
