// The columns of errors that the state carries for the step detector, through whatever moves the errors: propagation,
// updates of the base block and of the camera's poses, a moved point of reference, poses that come and go.
#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "navigation/filter.h"
#include "navigation/update.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr double kUnit = 1e-6;  // of the scale: a step small enough to be linear

/// What is measured: of the course as it is, where its own state predicts it, so that updates move that one by nothing
/// and the other by what is linear.
struct Measured {
  std::vector<double> speeds;
  std::vector<Eigen::Vector3d> ways;
};

struct Course {
  Measured& measured;
  bool makes;  ///< `measured`; else it uses it
  size_t next_speed = 0, next_way = 0;
  NavigationConfig config;
  Filter filter;
  Update update;
  int64_t t_us = 1'000'000, next_clone = 1;

  /// Begins with a wheel scale that is too low by `off`: what a step by so much has made of it.
  Course(double off, Measured& m) : measured(m), makes(off == 0.0), filter(config, inertial::Earth(), true) {
    Mean x;
    x.t_us = t_us;
    x.nav.velocity = Eigen::Vector3d(11.0, 2.0, 0.1);
    x.nav.position = Eigen::Vector3d(200.0, -100.0, 3.0);
    x.wheel_scale = -off;
    BaseVector std = BaseVector::Constant(1e-3);
    std.segment<3>(kVel).setConstant(0.3);
    std.segment<3>(kPos).setConstant(0.5);
    std(kWheelScale) = 0.01;
    filter.initialise(x, std);
    filter.watch_for_steps();
  }

  void drive(int samples) {
    for (int i = 0; i < samples; ++i) {
      t_us += 10'000;
      filter.predict({t_us, Eigen::Vector3d(0.01, 0.02, 0.3), Eigen::Vector3d(0.5, 3.0, 9.8)}, 0.01, {1e-3, 1e-2});
    }
  }

  void wheels() {
    const Mean& x = filter.state().x;
    Measurement<1> m;
    const Eigen::Vector3d ahead = x.R().col(0);
    const double speed = ahead.dot(x.nav.velocity);
    if (makes) measured.speeds.push_back(speed * (1.0 - x.wheel_scale));
    m.residual(0) = measured.speeds[next_speed++] - speed * (1.0 - x.wheel_scale);
    m.H.block<1, 3>(0, kVel) = (1.0 - x.wheel_scale) * ahead.transpose();
    m.H(0, kWheelScale) = -speed;
    m.R(0, 0) = 0.01;
    REQUIRE(filter.fuse(AidingSource::kWheelSpeed, t_us, m, 1e9).status == AidingStatus::kAccepted);
  }

  void clone() {
    filter.flush();
    filter.state().move_reference(filter.state().x.nav.position);
    filter.state().add_clone(next_clone++, Eigen::Vector3d(0.01, 0.02, 0.3), 1e-3);
  }

  /// Rows of the camera measure how far the newest pose is from the oldest.
  void poses() {
    filter.flush();
    State& state = filter.state();
    const Columns columns(state);
    Eigen::MatrixXd stack = Eigen::MatrixXd::Zero(3, columns.size() + 1);
    const auto last = state.clones.size() - 1;
    for (const size_t k : {size_t{0}, last}) {
      const double sign = k == 0 ? -1.0 : 1.0;
      stack.block<3, 3>(0, Columns::of_clone(k)) = -sign * skew(state.clones[k].p - state.p_ref);
      stack.block<3, 3>(0, Columns::of_clone(k) + 3) = sign * Eigen::Matrix3d::Identity();
    }
    const Eigen::Vector3d way = state.clones[last].p - state.clones[0].p;
    if (makes) measured.ways.push_back(way);
    const Eigen::Vector3d seen = measured.ways[next_way++];
    for (int i = 0; i < 3; ++i) stack(i, columns.size()) = seen(i) - way(i);
    update.begin(state);
    update.add(stack / 0.2, columns);
    REQUIRE(update.apply(state));
  }

  void run() {
    drive(23);
    wheels();
    clone();
    drive(17);
    wheels();
    clone();
    drive(11);
    poses();
    wheels();
    clone();
    poses();
    filter.state().remove_clone(1);
    drive(9);
    wheels();
    clone();
    poses();
    filter.flush();
  }
};

/// The errors of `is`, where `should` is true, of everything in the state.
Eigen::VectorXd error_of(const State& is, const State& should) {
  Eigen::VectorXd d(is.size());
  d.head<kBaseSize>() = local(is.x, should.x, is.p_ref);
  for (size_t k = 0; k < is.clones.size(); ++k) {
    const Clone &a = is.clones[k], &b = should.clones[k];
    const Eigen::Matrix3d dR = b.R * a.R.transpose();
    d.segment<3>(a.at) = log_q(Eigen::Quaterniond(dR));
    d.segment<3>(a.at + 3) = b.p - is.p_ref - dR * (a.p - is.p_ref);
  }
  return d;
}

}  // namespace

TEST_CASE("carried columns are what a step has made of every error, poses of the camera among them") {
  Measured measured;
  Course as_it_is(0.0, measured), stepped(kUnit, measured);
  as_it_is.run();
  stepped.run();
  const State& state = stepped.filter.state();
  REQUIRE(state.clones.size() == 3);
  const Eigen::VectorXd made = error_of(state, as_it_is.filter.state()) / kUnit;
  const Eigen::VectorXd carried = state.carried().col(0).head(state.size());
  CHECK((made - carried).norm() < 1e-3 * made.norm());
  // Poses have errors of their own, and forgetting them shows.
  const int poses = state.size() - kBaseSize;
  CHECK(made.tail(poses).norm() > 1e-2 * made.norm());
  CHECK(made(kWheelScale) > 0.0);
  CHECK(made(kWheelScale) < 0.9);
}
