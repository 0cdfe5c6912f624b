/// Two estimators, or two builds of one, on the same drives: is one worse?
///
/// Every value is a cost: zero or more, smaller is better. A change is counted as ln((b + floor) / (a + floor)): a
/// share (MODEL.md, (E.6.1)), whatever the size of the drive's error, and nothing where both are far below the floor.
#pragma once

#include <cstddef>
#include <vector>

namespace roadfix {

/// The mean change over all drives with its confidence interval by Student's t (differences of pairs: what is common to
/// a drive cancels).
struct PairedTest {
  int drives = 0;
  double mean_change = 0.0;  ///< share: 0.02 is 2 % worse
  double low = 0.0;          ///< of the confidence interval, share
  double high = 0.0;
  double p = 1.0;  ///< two-sided, of no change
  int worse = 0;   ///< drives
  int better = 0;
};

/// `a` and `b` by drive. Fewer than two drives have no interval: it is [-1, infinity).
PairedTest paired_test(const std::vector<double>& a, const std::vector<double>& b, double floor,
                       double confidence = 0.99);

/// (b + floor) / (a + floor) - 1.
double relative_change(double a, double b, double floor);

/// Indices of the drives that got worse by more than `tolerance` (a share), the worst first.
std::vector<std::size_t> regressions(const std::vector<double>& a, const std::vector<double>& b, double floor,
                                     double tolerance);

}  // namespace roadfix
