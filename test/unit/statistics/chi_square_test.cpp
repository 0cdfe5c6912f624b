#include "statistics/chi_square.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace roadfix {
namespace {

struct Tabulated {
  double probability, dof, value;
};

// NIST/SEMATECH e-Handbook of Statistical Methods, section 1.3.6.7.4, upper critical values, three digits.
const Tabulated kTable[] = {
    {0.90, 1, 2.706},   {0.95, 1, 3.841},   {0.99, 1, 6.635},    {0.999, 1, 10.828},   {0.95, 2, 5.991},
    {0.999, 2, 13.816}, {0.95, 3, 7.815},   {0.999, 3, 16.266},  {0.95, 6, 12.592},    {0.99, 6, 16.812},
    {0.999, 6, 22.458}, {0.95, 15, 24.996}, {0.999, 15, 37.697}, {0.95, 100, 124.342}, {0.999, 100, 149.449},
};

TEST_CASE("chi-square quantiles are those of the tables") {
  for (const Tabulated& t : kTable) {
    CAPTURE(t.probability, t.dof);
    CHECK(chi_square_quantile(t.probability, t.dof) == Approx(t.value).margin(6e-4).epsilon(0.0));
  }
}

TEST_CASE("chi-square with two degrees of freedom is exponential") {
  for (const double x : {1e-6, 0.01, 0.5, 2.0, 3.9, 4.1, 10.0, 60.0}) {
    CAPTURE(x);
    CHECK(chi_square_cdf(x, 2) == Approx(-std::expm1(-0.5 * x)).epsilon(1e-13));
    CHECK(chi_square_tail(x, 2) == Approx(std::exp(-0.5 * x)).epsilon(1e-13));
  }
}

TEST_CASE("chi-square with one degree of freedom is the square of a normal") {
  for (const double z : {0.1, 1.0, 2.0, 3.0, 5.0, 8.0}) {
    CHECK(chi_square_tail(z * z, 1) == Approx(std::erfc(z / std::sqrt(2.0))).epsilon(1e-12));
  }
}

TEST_CASE("chi-square quantile undoes the distribution from 1 to 100000 degrees") {
  for (const double dof : {1.0, 3.0, 15.0, 750.0, 1e5}) {
    for (const double p : {1e-6, 5e-4, 0.1, 0.5, 0.9, 0.9995}) {
      CAPTURE(dof, p);
      CHECK(chi_square_cdf(chi_square_quantile(p, dof), dof) == Approx(p).epsilon(1e-9));
    }
  }
}

TEST_CASE("normal quantiles are those of the tables") {
  CHECK(normal_quantile(0.975) == Approx(1.959963985).epsilon(1e-9));
  CHECK(normal_quantile(0.0005) == Approx(-3.290526731).epsilon(1e-9));
  CHECK(normal_quantile(0.5) == Approx(0.0).margin(1e-12));
}

}  // namespace
}  // namespace roadfix
