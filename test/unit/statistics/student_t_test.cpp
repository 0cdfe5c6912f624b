#include "statistics/student_t.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "statistics/chi_square.h"

using namespace roadfix;

TEST_CASE("Student's t has the quantiles of the printed tables") {
  // Abramowitz, Stegun 1964, table 26.10.
  CHECK(student_t_quantile(0.975, 1) == Approx(12.706).epsilon(1e-4));
  CHECK(student_t_quantile(0.975, 10) == Approx(2.228).epsilon(2e-4));
  CHECK(student_t_quantile(0.995, 5) == Approx(4.032).epsilon(2e-4));
  CHECK(student_t_quantile(0.9995, 30) == Approx(3.646).epsilon(2e-4));
  CHECK(student_t_quantile(0.5, 7) == 0.0);
}

TEST_CASE("Student's t of one degree is Cauchy's, of many the normal distribution") {
  for (const double t : {-30.0, -2.0, -0.3, 0.0, 0.7, 5.0}) {
    CHECK(student_t_cdf(t, 1) == Approx(0.5 + std::atan(t) / 3.14159265358979323846).epsilon(1e-12));
  }
  CHECK(student_t_quantile(0.99, 1e7) == Approx(normal_quantile(0.99)).epsilon(1e-6));
  CHECK(std::abs(student_t_quantile(0.99, 10) - normal_quantile(0.99)) > 0.3);  // and of few it is not
}

TEST_CASE("the quantile of Student's t inverts its distribution, far into the tails") {
  for (const double dof : {1.0, 3.0, 49.0, 199.0}) {
    for (const double probability : {1e-9, 0.003, 0.2, 0.6, 0.995}) {
      CHECK(student_t_cdf(student_t_quantile(probability, dof), dof) == Approx(probability).epsilon(1e-9));
    }
  }
}

TEST_CASE("the incomplete beta function has its closed forms") {
  CHECK(incomplete_beta(0.3, 1, 1) == Approx(0.3));
  CHECK(incomplete_beta(0.3, 2, 1) == Approx(0.09));
  CHECK(incomplete_beta(0.3, 3, 2) == Approx(4 * std::pow(0.3, 3) - 3 * std::pow(0.3, 4)));
  CHECK(incomplete_beta(0.0, 3, 2) == 0.0);
  CHECK(incomplete_beta(1.0, 3, 2) == 1.0);
}
