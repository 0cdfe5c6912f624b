#include "statistics/chi_square.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace roadfix {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr int kMaxTerms = 10000;

/// log of x^a e^-x / Gamma(a), the common factor of both expansions. std::lgamma is thread safe here: its sign output
/// (signgam) is not used.
double log_factor(double a, double x) { return a * std::log(x) - x - std::lgamma(a); }

/// Regularised lower incomplete gamma function P(a, x) by its series (Abramowitz, Stegun 1964, 6.5.29); for x < a + 1.
double gamma_series(double a, double x) {
  double term = 1.0 / a;
  double sum = term;
  for (int n = 1; n < kMaxTerms && term > sum * kEpsilon; ++n) {
    term *= x / (a + n);
    sum += term;
  }
  return sum * std::exp(log_factor(a, x));
}

/// Upper function Q(a, x) by its continued fraction (Abramowitz, Stegun 1964, 6.5.31), evaluated by the modified Lentz
/// method (Thompson, Barnett 1986); for x >= a + 1.
double gamma_fraction(double a, double x) {
  constexpr double kTiny = 1e-300;
  double b = x + 1.0 - a;
  double c = 1.0 / kTiny;
  double d = 1.0 / b;
  double fraction = d;
  for (int n = 1; n < kMaxTerms; ++n) {
    const double an = -n * (n - a);
    b += 2.0;
    d = 1.0 / std::max(an * d + b, kTiny);
    c = std::max(b + an / c, kTiny);
    const double step = c * d;
    fraction *= step;
    if (std::abs(step - 1.0) < kEpsilon) break;
  }
  return fraction * std::exp(log_factor(a, x));
}

double gamma_lower(double a, double x) {
  if (x <= 0.0) return 0.0;
  return x < a + 1.0 ? gamma_series(a, x) : 1.0 - gamma_fraction(a, x);
}

}  // namespace

double chi_square_cdf(double x, double dof) { return gamma_lower(0.5 * dof, 0.5 * x); }

double chi_square_tail(double x, double dof) {
  if (x <= 0.0) return 1.0;
  const double a = 0.5 * dof;
  return 0.5 * x < a + 1.0 ? 1.0 - gamma_series(a, 0.5 * x) : gamma_fraction(a, 0.5 * x);
}

double chi_square_quantile(double probability, double dof) {
  if (!(probability > 0.0)) return 0.0;
  if (!(probability < 1.0)) return std::numeric_limits<double>::infinity();
  // Bisection on the side of the distribution that keeps its digits; the bracket grows until it holds the answer.
  const bool upper = probability > 0.5;
  const auto beyond = [&](double x) {
    return upper ? chi_square_tail(x, dof) < 1.0 - probability : chi_square_cdf(x, dof) > probability;
  };
  double low = 0.0;
  double high = std::max(1.0, 2.0 * dof);
  while (!beyond(high)) high *= 2.0;
  while (true) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high || high - low <= 4.0 * kEpsilon * high) return middle;
    (beyond(middle) ? high : low) = middle;
  }
}

double normal_quantile(double probability) {
  // |Z| <= z has the chi-square distribution of z^2 with one degree of freedom.
  const double two_sided = std::abs(2.0 * probability - 1.0);
  const double z = std::sqrt(chi_square_quantile(two_sided, 1.0));
  return probability < 0.5 ? -z : z;
}

}  // namespace roadfix
