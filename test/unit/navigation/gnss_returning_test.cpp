// The states of what a receiver brings back from an outage: how they move together, and that they leave no trace.
#include <catch2/catch.hpp>

#include "navigation/aiding/gnss_error_states.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

/// Half a second later; the displacement's mean is given, and the logarithm of its rate is off by `rate_off`.
Filter half_a_second(double rate_off) {
  Filter filter(NavigationConfig(), inertial::Earth(), false);
  filter.initialise(Mean(), BaseVector::Constant(0.1));
  begin_gnss_return(filter, {3.0, 3.0, 6.0});
  filter.state().x.gnss_return = {2.0, -1.0, 0.5};
  filter.state().x.return_rate += rate_off;
  for (int i = 1; i <= 50; ++i) {
    ImuSample imu;
    imu.t_us = i * 10'000;
    imu.accel = {0.0, 0.0, 9.81};
    filter.predict(imu, 0.01, inertial::ImuNoise{1e-4, 1e-3});
  }
  filter.flush();
  return filter;
}

}  // namespace

TEST_CASE("what a receiver brought back fades, and its rate's error goes over to it") {
  constexpr double kStep = 1e-4;
  const Filter f = half_a_second(0.0), more = half_a_second(kStep), less = half_a_second(-kStep);
  const Eigen::MatrixXd& P = f.state().P();
  const Eigen::Vector3d by_rate = (more.state().x.gnss_return - less.state().x.gnss_return) / (2.0 * kStep);
  CHECK(f.state().x.gnss_return.x() == Approx(2.0 * std::exp(-0.5 / 2.5)));
  for (int i = 0; i < 3; ++i) {
    CAPTURE(i);
    // The rate's own walk adds a few per cent.
    CHECK(P(kGnssReturn + i, kReturnRate) == Approx(by_rate(i) * 1.2 * 1.2).epsilon(0.05));
  }
  CHECK(P(kGnssReturn, kGnssReturn) > 9.0 * std::exp(-1.0 / 2.5));
  CHECK(P == P.transpose());
  CHECK(P.llt().info() == Eigen::Success);
}

TEST_CASE("a return that is over leaves nothing of itself") {
  Filter f = half_a_second(0.0);
  CHECK(f.state().gnss_returns());
  CHECK(gnss_return_size(f.state()) > 1.0);
  end_gnss_return(f);
  CHECK_FALSE(f.state().gnss_returns());
  CHECK(f.state().x.gnss_return.isZero(0.0));
  CHECK(f.state().P().middleCols<4>(kGnssReturn).isZero(0.0));
  CHECK(f.state().P().middleRows<4>(kGnssReturn).isZero(0.0));
}
