// The low pass of a receiver's velocities: the lag against a filter made in small steps, and the time constant that the
// innovations show.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <deque>
#include <random>

#include "navigation/aiding/gnss_velocity/smoothing_time.h"

using namespace roadfix::navigation;

namespace {

constexpr double kImu = 0.01, kFix = 0.25, kSigma = 0.05;  // s, s, m/s

/// A car that speeds up, goes on and brakes again and again.
Eigen::Vector3d acceleration_at(double t, double most) {
  return most * std::sin(0.5 * t) * Eigen::Vector3d(0.8, 0.6, 0.0);
}

/// A receiver, and what is known of its latency: s, and the sigma of that of `latency`.
struct Receiver {
  double tau = 0.0, latency = 0.0, latency_std = 0.0;
  double step = 0.0;   ///< s, of its clock in the middle of the drive; the latency that is estimated steps too
  bool found = false;  ///< that step, in its positions
};

/// What `duration` s of velocities of this receiver, claimed right, leave to be believed of each time constant. The latency is
/// estimated by a scalar Kalman filter beside it, as the navigation filter does; its last value goes to `latency`.
SmoothingTime learnt(const Receiver& receiver, double most, double duration, unsigned seed, double* latency = nullptr) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> n(0.0, kSigma);
  SmoothingTime time(receiver.latency_std);
  double late = 0.0, late_variance = receiver.latency_std * receiver.latency_std;
  std::deque<Eigen::Vector3d> told;
  double latency_now = receiver.latency, clock = 0.0;
  VelocityLag lag;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero(), filtered = Eigen::Vector3d::Zero();
  const int fix = static_cast<int>(kFix / kImu);
  for (int i = 1; i * kImu < duration; ++i) {
    const Eigen::Vector3d before = velocity;
    velocity += kImu * acceleration_at(i * kImu, most);
    filtered = receiver.tau == 0.0 ? velocity
                                   : Eigen::Vector3d(velocity + std::exp(-kImu / receiver.tau) * (filtered - velocity));
    told.push_back(filtered);
    if (i == static_cast<int>(0.5 * duration / kImu)) {
      latency_now += receiver.step;
      late += receiver.step;
      if (receiver.found) clock = receiver.step;
    }
    if (static_cast<double>(told.size()) * kImu > 1.0) told.pop_front();
    lag.advance(velocity - before, kImu);
    if (i % fix != 0) continue;
    const Eigen::Vector3d a = acceleration_at(i * kImu, most);
    const SmoothingTime::Expected e = time.expected(lag, a, Eigen::Vector3d::Zero());
    const size_t ago = std::min(told.size() - 1, static_cast<size_t>(latency_now / kImu + 0.5));
    const Eigen::Vector3d innovation =
        told[told.size() - 1 - ago] + Eigen::Vector3d(n(rng), n(rng), n(rng)) - (velocity + e.lag - late * e.rate);
    const Eigen::Vector3d variance =
        e.spread.diagonal().array() + kSigma * kSigma + late_variance * e.rate.array().square();
    AidingRecord r;
    r.dof = 3;
    for (int k = 0; k < 3; ++k) {
      r.innovation[static_cast<size_t>(k)] = innovation(k);
      r.innovation_variance[static_cast<size_t>(k)] = variance(k);
    }
    const double late_before = late, speed = e.rate.norm();
    if (speed > 1e-6) {
      const Eigen::Vector3d along = e.rate / speed;
      const double S = along.dot((variance.asDiagonal() * along).eval());
      const double gain = -late_variance * speed / S;
      late += gain * along.dot(innovation);
      late_variance *= 1.0 + gain * speed;
    }
    late += time.learn(r, lag, a, Eigen::Vector3d::Zero(), late_before - clock);
  }
  if (latency != nullptr) *latency = late;
  return time;
}

}  // namespace

TEST_CASE("the lag is that of a low pass, and none without one") {
  VelocityLag lag;
  for (int i = 0; i < 1000; ++i) lag.advance(Eigen::Vector3d(0.02, 0.0, 0.0), kImu);  // 2 m/s2
  const Eigen::Vector3d a(2.0, 0.0, 0.0);
  CHECK(lag.lag(0).isZero());
  CHECK(lag.rate(0, a) == a);
  for (int k = 1; k < VelocityLag::kCount; ++k) {
    const double tau = VelocityLag::time(k), reached = 1.0 - std::exp(-10.0 / tau);
    CAPTURE(tau);
    CHECK(std::abs(lag.lag(k).x() / (-2.0 * tau * reached) - 1.0) < 0.01);
    CHECK(std::abs(lag.rate(k, a).x() / (2.0 * reached) - 1.0) < 0.01);
  }
}

TEST_CASE("accelerations show the receiver's time constant, or that it has none") {
  for (int k = 0; k < VelocityLag::kCount; ++k)
    for (unsigned seed = 1; seed <= 5; ++seed) {
      CAPTURE(k, seed);
      CHECK(learnt({VelocityLag::time(k)}, 2.0, 30.0, seed).probability(k) > 0.99);
    }
}

TEST_CASE("a time constant in between goes to its neighbours") {
  const SmoothingTime t = learnt({0.35}, 2.0, 30.0, 1);
  CHECK(t.probability(2) + t.probability(3) > 0.99);
  CHECK(t.probability(0) < 0.01);
}

TEST_CASE("a steady speed shows nothing") {
  const SmoothingTime before(0.0), t = learnt({1.0}, 0.0, 30.0, 1);
  for (int k = 0; k < VelocityLag::kCount; ++k) CHECK(std::abs(t.probability(k) - before.probability(k)) < 1e-12);
}

TEST_CASE("a receiver that is late is taken for one, and a low pass is not its opposite") {
  for (const double tau : {0.0, 0.5})
    for (unsigned seed = 1; seed <= 5; ++seed) {
      CAPTURE(tau, seed);
      double latency = 0.0;
      const SmoothingTime t = learnt({tau, 0.3, 0.3}, 2.0, 120.0, seed, &latency);
      double all = latency;
      for (int k = 0; k < VelocityLag::kCount; ++k) all += t.probability(k) * VelocityLag::time(k);
      CHECK(std::abs(all - tau - 0.3) < 0.05);  // what slow accelerations tell is the sum
      CHECK(std::abs(latency - 0.3) < 0.15);
      CHECK(t.probability(VelocityLag::kCount - 1) < 0.01);
    }
  // Taken for one that is never late, it has a low pass.
  CHECK(learnt({0.0, 0.3, 0.0}, 2.0, 120.0, 1).probability(0) < 0.01);
}

TEST_CASE("a clock that steps is no low pass, and leaves what was known of one") {
  for (const int k : {0, 3})
    for (unsigned seed = 1; seed <= 5; ++seed) {
      CAPTURE(k, seed);
      double latency = 0.0;
      const SmoothingTime t = learnt({VelocityLag::time(k), 0.0, 0.0, 0.1, true}, 2.0, 60.0, seed, &latency);
      CHECK(t.probability(k) > 0.99);
      CHECK(std::abs(latency - 0.1) < 0.02);
    }
  // Teeth: by evidence that takes the latency for what it was, a low pass.
  CHECK(learnt({0.0, 0.0, 0.0, 0.1, false}, 2.0, 60.0, 1).probability(0) < 0.01);
}
