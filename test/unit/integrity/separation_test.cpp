#include "integrity/separation.h"

#include <catch2/catch.hpp>

#include "small_witnessed_car.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

/// An error-free estimate beside dead reckoning that is 1 % long, turned by 0.01 rad/s and 30 deg; `moved` is added.
struct Beside {
  explicit Beside(const IntegrityConfig& config = {}) : monitor(config) {}

  void go(double seconds, const Eigen::Vector3d& moved_by = Eigen::Vector3d::Zero()) {
    for (int i = 0; i < static_cast<int>(seconds * 10.0 + 0.5); ++i) {
      t += 0.1;
      car.yaw += 0.1 * TrueCar::rate(t);
      car.p += 0.1 * speed * Eigen::Vector3d(std::cos(car.yaw), std::sin(car.yaw), 0.0);
      moved += 0.1 * moved_by;
      yaw += 0.1 * (TrueCar::rate(t) + 0.001);
      p += 0.1 * speed * scale * Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0);
      const auto t_us = static_cast<int64_t>(t * 1e6 + 0.5);
      Odometry witness = pose(t_us, p, yaw, TrueCar::rate(t), 0.1);
      Odometry estimate = pose(t_us, car.p + moved, car.yaw, TrueCar::rate(t), 0.01);
      witness.velocity.x() = estimate.velocity.x() = speed;
      if (witnessed) monitor.add_witness(witness, jumps);
      monitor.step(estimate);
      if (!monitor.contradicted() && learns) monitor.learn();
      contradicted = contradicted || monitor.contradicted();
    }
  }

  SeparationMonitor monitor;
  TrueCar car;
  Eigen::Vector3d p = Eigen::Vector3d::Zero(), moved = Eigen::Vector3d::Zero();
  double t = 0.0, yaw = 0.8, scale = 1.01, speed = 15.0;
  int64_t jumps = 0;
  bool witnessed = true, learns = true, contradicted = false;
};

}  // namespace

TEST_CASE("separation: the witness's scale and turn are learnt, so that a slow drift along and across is found") {
  Beside b;
  b.go(100.0);
  CHECK_FALSE(b.contradicted);
  const Separation s = b.monitor.since(*b.monitor.before(3.0));
  CHECK(s.witnessed);
  CHECK(std::abs(s.d.x()) < 0.02);  // 1 % of 45 m is 0.45 m
  CHECK(std::abs(s.d.y()) < 0.02);
  Beside along = b, across = b;
  const Eigen::Vector3d ahead(std::cos(b.car.yaw), std::sin(b.car.yaw), 0.0);
  along.go(5.0, 0.3 * ahead);
  across.go(5.0, 0.3 * Eigen::Vector3d(-ahead.y(), ahead.x(), 0.0));
  CHECK(along.contradicted);
  CHECK(across.contradicted);
  b.go(5.0);
  CHECK_FALSE(b.contradicted);
}

TEST_CASE("separation: a wheel scale learnt on a straight holds in a bend and in reverse, a drift is found there too") {
  Beside b;
  b.scale = 1.03;
  b.go(59.0);
  Beside pulled = b;
  b.go(30.0);  // a bend of 1.5 rad
  const Separation bend = b.monitor.since(*b.monitor.before(20.0));
  CHECK(std::abs(bend.d.x()) < 3.0 * bend.sigma.x());  // 3 % of 300 m is 9 m
  CHECK(std::abs(bend.d.y()) < 3.0 * bend.sigma.y());
  b.speed = -5.0;
  b.go(20.0);
  const Separation reverse = b.monitor.since(*b.monitor.before(8.0));
  CHECK(std::abs(reverse.d.x()) < 0.05);  // 3 % of 40 m, on either side of none, is 1.2 m
  CHECK_FALSE(b.contradicted);
  pulled.go(12.0, {0.2, 0.2, 0.0});
  CHECK(pulled.contradicted);
}

TEST_CASE("separation: without having learnt, the same drift is within what dead reckoning may be off by") {
  Beside b;
  b.learns = false;
  b.go(100.0);
  const Separation s = b.monitor.since(*b.monitor.before(3.0));
  CHECK(std::abs(s.d.x()) > 0.3);
  CHECK(std::abs(s.d.x()) < 3.0 * s.sigma.x());
}

TEST_CASE("separation: the sigma of a separation grows with the way, and without a witness with time") {
  Beside b;
  b.go(30.0);
  const Separation near = b.monitor.since(*b.monitor.before(2.0)), far = b.monitor.since(*b.monitor.before(8.0));
  for (int a = 0; a < 3; ++a) CHECK(far.sigma(a) > near.sigma(a));
  Beside alone;
  alone.witnessed = false;
  alone.go(30.0);
  const Separation own = alone.monitor.since(*alone.monitor.before(2.0));
  CHECK_FALSE(own.witnessed);
  for (int a = 0; a < 3; ++a) CHECK(own.sigma(a) > near.sigma(a));
}

TEST_CASE("separation: a witness that began anew or fell silent bears no witness over that time") {
  Beside b;
  b.go(20.0);
  b.jumps = 1;
  b.p = {1000.0, 0.0, 0.0};
  b.go(1.0);
  CHECK_FALSE(b.contradicted);
  CHECK_FALSE(b.monitor.since(*b.monitor.before(3.0)).witnessed);
  b.go(6.0);
  CHECK(b.monitor.since(*b.monitor.before(3.0)).witnessed);
  b.witnessed = false;
  b.go(1.0);
  CHECK_FALSE(b.monitor.since(*b.monitor.before(0.5)).witnessed);
}
