// The whole filter on simulated drives: what it must survive, say and repeat to the bit.
#include <catch2/catch.hpp>
#include <limits>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

SimulatedDrive short_drive(double duration_s) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = duration_s;
  return simulate(s, 3);
}

struct Final {
  NavigationOutput output;
  NavigationStatus status;
  std::optional<Filter> core;
  Eigen::Matrix<double, 9, 1> error = Eigen::Matrix<double, 9, 1>::Constant(1e9);
  int gated = 0, bad = 0;
};

Final drive_it(const SimulatedDrive& drive, const navtest::Samples& samples) {
  Navigation filter(navtest::filter_config(drive.config));
  Final last;
  navtest::run(filter, samples, [&](Navigation& f, int64_t) {
    for (const AidingRecord& r : f.records()) {
      last.gated += r.status == AidingStatus::kGated && r.source == AidingSource::kGnssPosition;
      last.bad += r.status == AidingStatus::kBadInput;
    }
    f.clear_records();
  });
  last.output = filter.output();
  last.status = filter.status();
  if (filter.filter() != nullptr) last.core = *filter.filter();
  if (filter.anchor()) last.error = navtest::error_of(filter, last.output.imu, drive);
  return last;
}

bool same_bits(const Filter& a, const Filter& b) {
  return local(a.state().x, b.state().x, Eigen::Vector3d::Zero()).isZero(0.0) && a.state().P() == b.state().P();
}

const SimulatedDrive& drive() {
  static const SimulatedDrive kDrive = short_drive(60.0);
  return kDrive;
}

size_t fix_at(const navtest::Samples& s, double t) {
  size_t i = 0;
  while (seconds_between(s.gnss.front().t_us, s.gnss[i].t_us) < t) ++i;
  return i;
}

void move(GnssFix& fix, const Eigen::Vector3d& by) { fix.antenna = EnuAnchor(fix.antenna).geodetic(by); }

}  // namespace

TEST_CASE("a drive from standing ends aligned, valid and near the truth") {
  const Final f = drive_it(drive(), navtest::Samples(drive()));
  CHECK(f.status.phase == Phase::kDone);
  CHECK(f.output.odometry.validity == Validity::kValid);
  CHECK(f.output.reason.empty());
  CHECK(f.error.head<2>().norm() < 0.1);
  CHECK(f.error.segment<3>(3).norm() < 0.02);
}

TEST_CASE("the covariance is symmetric to the bit and positive definite") {
  const Final f = drive_it(drive(), navtest::Samples(drive()));
  const Eigen::MatrixXd P = f.core->state().P();
  CHECK(P == P.transpose());
  // States with a certain value (latencies without a sigma) have zero rows; the others must be definite.
  CHECK((P + 1e-15 * Eigen::MatrixXd::Identity(P.rows(), P.rows())).eval().llt().info() == Eigen::Success);
}

TEST_CASE("a gated fix leaves the same bits as no fix") {
  navtest::Samples spiked(drive()), without(drive());
  const size_t i = fix_at(spiked, 50.0);
  move(spiked.gnss[i], {20.0, 0.0, 0.0});
  without.gnss.erase(without.gnss.begin() + static_cast<ptrdiff_t>(i));
  spiked.gnss[i].velocity.reset();
  const Final a = drive_it(drive(), spiked), b = drive_it(drive(), without);
  CHECK(a.gated == b.gated + 1);
  CHECK(same_bits(*a.core, *b.core));
  // Teeth: a fix that passes the gate changes them.
  CHECK_FALSE(same_bits(*a.core, *drive_it(drive(), navtest::Samples(drive())).core));
}

TEST_CASE("a snapshot continues to the same bits") {
  navtest::Samples samples(drive());
  move(samples.gnss[fix_at(samples, 52.0)], {20.0, 0.0, 0.0});  // so that a refusal is among what goes on
  for (const double share : {0.05, 0.12, 0.5}) {                // before, while and after it aligns
    CAPTURE(share);
    Navigation whole(navtest::filter_config(drive().config)), resumed(navtest::filter_config(drive().config));
    navtest::Feeder feeder(samples);
    for (auto left = static_cast<size_t>(share * static_cast<double>(samples.imu.size())); left > 0; --left) {
      feeder.step(whole);
      (void)whole.output();
    }
    const std::vector<uint8_t> snapshot = whole.save();
    resumed.load(snapshot);
    CHECK(resumed.save() == snapshot);
    CHECK_THROWS(
        Navigation(navtest::filter_config(drive().config)).load(std::span(snapshot).first(snapshot.size() / 2)));
    whole.clear_records();
    bool same = true, same_records = true;
    for (navtest::Feeder other = feeder; feeder.step(whole) && other.step(resumed);) {
      const NavigationOutput a = whole.output(), b = resumed.output();
      same = same && a.odometry.T_frame_vehicle.p == b.odometry.T_frame_vehicle.p &&
             a.odometry.T_frame_vehicle.q.coeffs() == b.odometry.T_frame_vehicle.q.coeffs() &&
             a.odometry.cov_pose == b.odometry.cov_pose && a.odometry.velocity == b.odometry.velocity &&
             a.reason == b.reason && a.odometry.validity == b.odometry.validity;
      same_records = same_records && whole.records().size() == resumed.records().size();
      whole.clear_records();
      resumed.clear_records();
    }
    CHECK(same);
    CHECK(same_records);
    CHECK(whole.save() == resumed.save());
  }
}

TEST_CASE("shifted stamps give the same estimate") {
  navtest::Samples shifted(drive());
  constexpr int64_t kShift = 86'400'000'000;
  for (ImuSample& s : shifted.imu) s.t_us += kShift;
  for (GnssFix& s : shifted.gnss) s.t_us += kShift;
  for (WheelSample& s : shifted.wheels) s.t_us += kShift;
  Navigation filter(navtest::filter_config(drive().config));
  navtest::run(filter, shifted, [](Navigation&, int64_t) {});
  const Final f = drive_it(drive(), navtest::Samples(drive()));
  CHECK(local(f.core->state().x, filter.filter()->state().x, Eigen::Vector3d::Zero()).isZero(0.0));
}

TEST_CASE("NaN samples and wild readings are counted and survived") {
  navtest::Samples s(drive());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (size_t i = 4000; i < 4010; ++i) s.imu[i].accel.x() = nan;
  s.imu[4100].gyro.z() = 1e6;
  s.gnss[fix_at(s, 45.0)].antenna.latitude = nan;
  s.gnss[fix_at(s, 46.0)].antenna = {0.0, 0.0, 0.0};
  const Final f = drive_it(drive(), s);
  CHECK(f.status.bad_imu_samples >= 11);
  CHECK(f.bad == 2);
  CHECK(f.error.head<2>().norm() < 0.2);
}

TEST_CASE("a gap of two seconds is bridged and said") {
  navtest::Samples s(drive());
  s.imu.erase(s.imu.begin() + 4000, s.imu.begin() + 4200);
  const Final f = drive_it(drive(), s);
  CHECK(f.status.imu_gaps == 1);
  CHECK(f.output.odometry.validity == Validity::kValid);
  CHECK(f.error.head<2>().norm() < 0.3);
}

TEST_CASE("a time that runs backwards is refused") {
  Navigation filter(navtest::filter_config(drive().config));
  const navtest::Samples s(drive());
  CHECK(filter.see(s.imu[1]) == InputStatus::kAccepted);
  CHECK(filter.see(s.imu[0]) == InputStatus::kOutOfOrder);
  CHECK(filter.see(s.imu[1]) == InputStatus::kOutOfOrder);
}

TEST_CASE("a frozen IMU is said and does not drag the pose away") {
  navtest::Samples s(drive());
  for (size_t i = 5000; i < s.imu.size(); ++i) {
    s.imu[i].gyro = s.imu[5000].gyro;
    s.imu[i].accel = s.imu[5000].accel;
  }
  const Final f = drive_it(drive(), s);
  CHECK(f.status.imu_frozen);
  CHECK_FALSE(f.output.reason.empty());
  CHECK(f.error.head<2>().norm() < 3.0);
}

TEST_CASE("a height above mean sea level, 40 m off, costs the height and not the place") {
  navtest::Samples s(drive());
  for (size_t i = fix_at(s, 48.0); i < s.gnss.size(); ++i) move(s.gnss[i], {0.0, 0.0, 40.0});
  const Final f = drive_it(drive(), s);
  CHECK(f.error.head<2>().norm() < 0.2);
  CHECK(f.output.reason == "the height of GNSS contradicts and is taken for an error of the receiver");
  CHECK(f.status.gnss_reason == f.output.reason);
  CHECK(f.output.reset_counter == 0);
  CHECK(drive_it(drive(), navtest::Samples(drive())).output.reason.empty());
}

TEST_CASE("a covariance that is not finite is refused and leaves the same bits as no fix") {
  navtest::Samples s(drive()), without(drive());
  const size_t i = fix_at(s, 50.0);
  s.gnss[i].cov_enu.setConstant(std::numeric_limits<double>::infinity());
  without.gnss.erase(without.gnss.begin() + static_cast<ptrdiff_t>(i));
  CHECK(same_bits(*drive_it(drive(), s).core, *drive_it(drive(), without).core));
}
