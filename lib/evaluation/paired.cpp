#include "evaluation/paired.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "statistics/student_t.h"
#include "statistics/summary.h"

namespace roadfix {

double relative_change(double a, double b, double floor) { return (b + floor) / (a + floor) - 1.0; }

PairedTest paired_test(const std::vector<double>& a, const std::vector<double>& b, double floor, double confidence) {
  PairedTest test;
  std::vector<double> changes;
  for (std::size_t i = 0; i < a.size(); ++i) {
    changes.push_back(std::log((b[i] + floor) / (a[i] + floor)));
    if (b[i] > a[i]) ++test.worse;
    if (b[i] < a[i]) ++test.better;
  }
  test.drives = static_cast<int>(changes.size());
  const double middle = mean(changes);
  test.mean_change = std::expm1(middle);
  test.low = -1.0;
  test.high = std::numeric_limits<double>::infinity();
  if (test.drives < 2) return test;
  double squares = 0.0;
  for (const double change : changes) squares += (change - middle) * (change - middle);
  const double dof = test.drives - 1;
  const double error = std::sqrt(squares / dof / test.drives);
  const double reach = student_t_quantile(0.5 + 0.5 * confidence, dof) * error;
  test.low = std::expm1(middle - reach);
  test.high = std::expm1(middle + reach);
  // Equal changes everywhere leave no doubt; no change at all leaves nothing to doubt.
  test.p = error > 0.0 ? 2.0 * student_t_cdf(-std::abs(middle) / error, dof) : middle == 0.0 ? 1.0 : 0.0;
  return test;
}

std::vector<std::size_t> regressions(const std::vector<double>& a, const std::vector<double>& b, double floor,
                                     double tolerance) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (relative_change(a[i], b[i], floor) > tolerance) out.push_back(i);
  }
  std::stable_sort(out.begin(), out.end(), [&](std::size_t x, std::size_t y) {
    return relative_change(a[x], b[x], floor) > relative_change(a[y], b[y], floor);
  });
  return out;
}

}  // namespace roadfix
