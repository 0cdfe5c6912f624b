// What must not change the estimate, and what the estimate must not cost: duplicates, order, origin, place, step
// length.
#include <catch2/catch.hpp>
#include <span>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

SimulatedDrive drive_at(double latitude_deg, double longitude_deg) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 60.0;
  s.anchor_lat_deg = latitude_deg;
  s.anchor_lon_deg = longitude_deg;
  return simulate(s, 3);
}

const SimulatedDrive& drive() {
  static const SimulatedDrive kDrive = drive_at(48.137, 11.575);
  return kDrive;
}

/// The filter at the end of the drive.
Navigation after(const SimulatedDrive& d, const navtest::Samples& samples) {
  Navigation filter(navtest::filter_config(d.config));
  navtest::run(filter, samples, [](Navigation& f, int64_t) { f.clear_records(); });
  return filter;
}

Eigen::Matrix<double, 9, 1> error_after(const SimulatedDrive& d) {
  Navigation filter = after(d, navtest::Samples(d));
  return navtest::error_of(filter, filter.output().imu, d);
}

/// How far two filters' positions lie apart, whatever their anchors, m.
double apart(const Navigation& a, const Navigation& b) {
  const EnuAnchor enu_a(*a.anchor()), enu_b(*b.anchor());
  return (enu_a.enu(enu_b.geodetic(b.filter()->state().x.nav.position)) - a.filter()->state().x.nav.position).norm();
}

}  // namespace

TEST_CASE("a fix that comes twice counts once") {
  navtest::Samples twice(drive());
  twice.gnss.clear();
  for (const GnssFix& fix : drive().gnss) twice.gnss.insert(twice.gnss.end(), 2, fix);
  const Navigation once = after(drive(), navtest::Samples(drive())), doubled = after(drive(), twice);
  CHECK(local(once.filter()->state().x, doubled.filter()->state().x, Eigen::Vector3d::Zero()).isZero(0.0));
  CHECK(once.filter()->state().P() == doubled.filter()->state().P());
}

TEST_CASE("two fixes of one time may be swapped") {
  const auto with_second = [](bool first) {
    navtest::Samples s(drive());
    s.gnss.erase(s.gnss.begin() + 1, s.gnss.end());  // the very first fix is the origin and comes alone
    for (const GnssFix& fix : std::span(drive().gnss).subspan(1)) {
      GnssFix other = fix;
      other.antenna = EnuAnchor(fix.antenna).geodetic({0.01, -0.02, 0.03});
      s.gnss.push_back(first ? other : fix);
      s.gnss.push_back(first ? fix : other);
    }
    return after(drive(), s);
  };
  const Navigation a = with_second(false), b = with_second(true);
  CHECK(local(a.filter()->state().x, b.filter()->state().x, Eigen::Vector3d::Zero()).isZero(0.0));
  CHECK(a.filter()->state().P() == b.filter()->state().P());
  // Teeth: the second receiver does change the estimate.
  CHECK(apart(a, after(drive(), navtest::Samples(drive()))) > 2e-3);
}

TEST_CASE("another origin gives the same place") {
  navtest::Samples moved(drive());
  GnssFix rough = moved.gnss.front();
  rough.t_us -= 100'000;
  rough.antenna = EnuAnchor(rough.antenna).geodetic({300.0, -400.0, 0.0});
  rough.cov_enu = 400.0 * Eigen::Matrix3d::Identity();
  rough.velocity.reset();
  moved.gnss.insert(moved.gnss.begin(), rough);
  const Navigation a = after(drive(), navtest::Samples(drive())), b = after(drive(), moved);
  CHECK(EnuAnchor(*a.anchor()).enu(*b.anchor()).norm() > 400.0);
  CHECK(apart(a, b) < 5e-3);
}

TEST_CASE("near the poles and across the date line it is as good as anywhere") {
  for (const auto& [latitude, longitude] :
       {std::pair(89.9, 45.0), std::pair(-89.9, 0.0), std::pair(-17.0, 179.9999), std::pair(0.0, -180.0)}) {
    CAPTURE(latitude, longitude);
    const auto e = error_after(drive_at(latitude, longitude));
    CHECK(e.head<3>().norm() < 0.1);
    CHECK(e.segment<3>(3).norm() < 0.02);
  }
}

TEST_CASE("IMU steps split in two give the same estimate") {
  navtest::Samples split(drive());
  split.imu.clear();
  int64_t before = drive().imu.front().t_us - 10'000;
  for (const ImuSample& s : drive().imu) {
    ImuSample half = s;
    half.t_us = before + (s.t_us - before) / 2;
    split.imu.push_back(half);
    split.imu.push_back(s);
    before = s.t_us;
  }
  const Navigation a = after(drive(), navtest::Samples(drive())), b = after(drive(), split);
  CHECK(apart(a, b) < 0.01);
  CHECK(local(a.filter()->state().x, b.filter()->state().x, Eigen::Vector3d::Zero()).segment<3>(kAtt).norm() < 1e-3);
}
