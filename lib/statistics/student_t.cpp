#include "statistics/student_t.h"

#include <cmath>
#include <limits>

namespace roadfix {
namespace {

constexpr double kRounding = std::numeric_limits<double>::epsilon();
constexpr int kMaxFractions = 10000;

/// Continued fraction of the incomplete beta function (Abramowitz, Stegun 1964, 26.5.8), evaluated by the modified
/// Lentz method (Thompson, Barnett 1986); converges fast for x < (a + 1) / (a + b + 2).
double beta_fraction(double x, double a, double b) {
  constexpr double kTiny = 1e-300;
  const auto away = [](double value) { return std::abs(value) < kTiny ? kTiny : value; };
  double c = 1.0;
  double d = 1.0 / away(1.0 - (a + b) * x / (a + 1.0));
  double fraction = d;
  for (int m = 1; m < kMaxFractions; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m));
    d = 1.0 / away(1.0 + even * d);
    c = away(1.0 + even / c);
    fraction *= c * d;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0));
    d = 1.0 / away(1.0 + odd * d);
    c = away(1.0 + odd / c);
    fraction *= c * d;
    if (std::abs(c * d - 1.0) < kRounding) break;
  }
  return fraction;
}

}  // namespace

double incomplete_beta(double x, double a, double b) {
  if (!(x > 0.0)) return 0.0;
  if (!(x < 1.0)) return 1.0;
  const double log_factor = std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x);
  const double factor = std::exp(log_factor);
  return x < (a + 1.0) / (a + b + 2.0) ? factor * beta_fraction(x, a, b) / a
                                       : 1.0 - factor * beta_fraction(1.0 - x, b, a) / b;
}

double student_t_cdf(double t, double dof) {
  // Abramowitz, Stegun 1964, 26.7.1 with 26.5.27: both tails are I_x(dof / 2, 1 / 2).
  const double tail = 0.5 * incomplete_beta(dof / (dof + t * t), 0.5 * dof, 0.5);
  return t > 0.0 ? 1.0 - tail : tail;
}

double student_t_quantile(double probability, double dof) {
  if (!(probability > 0.0)) return -std::numeric_limits<double>::infinity();
  if (!(probability < 1.0)) return std::numeric_limits<double>::infinity();
  if (probability > 0.5) return -student_t_quantile(1.0 - probability, dof);
  if (probability == 0.5) return 0.0;
  double low = -1.0;
  double high = 0.0;
  while (student_t_cdf(low, dof) > probability) low *= 2.0;
  while (true) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high || high - low <= -4.0 * kRounding * low) return middle;
    (student_t_cdf(middle, dof) > probability ? high : low) = middle;
  }
}

}  // namespace roadfix
