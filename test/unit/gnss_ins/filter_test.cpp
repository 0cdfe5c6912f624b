// The whole filter on simulated drives: what it must survive, say and repeat to the bit.
#include <catch2/catch.hpp>
#include <limits>

#include "filter_run.h"

using namespace roadfix;

namespace {

SimulatedDrive short_drive(double duration_s) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = duration_s;
  return simulate(s, 3);
}

struct Final {
  GnssInsOutput output;
  GnssInsStatus status;
  std::optional<InsCore> core;
  Eigen::Matrix<double, 9, 1> error = Eigen::Matrix<double, 9, 1>::Constant(1e9);
  int gated = 0, bad = 0;
};

Final drive_it(const SimulatedDrive& drive, const test::Samples& samples) {
  GnssIns filter(test::filter_config(drive.config));
  Final last;
  test::run(filter, samples, [&](GnssIns& f, int64_t) {
    for (const AidingRecord& r : f.records()) {
      last.gated += r.status == AidingStatus::kGated && r.source == AidingSource::kGnssPosition;
      last.bad += r.status == AidingStatus::kBadInput;
    }
    f.clear_records();
  });
  last.output = filter.output();
  last.status = filter.status();
  if (filter.core() != nullptr) last.core = *filter.core();
  if (filter.anchor()) last.error = test::error_of(filter, last.output.odometry, drive);
  return last;
}

bool same_bits(const InsCore& a, const InsCore& b) {
  return local(a.state(), b.state()).isZero(0.0) && a.covariance() == b.covariance();
}

const SimulatedDrive& drive() {
  static const SimulatedDrive kDrive = short_drive(60.0);
  return kDrive;
}

size_t fix_at(const test::Samples& s, double t) {
  size_t i = 0;
  while (seconds_between(s.gnss.front().t_us, s.gnss[i].t_us) < t) ++i;
  return i;
}

void move(GnssFix& fix, const Eigen::Vector3d& by) { fix.antenna = EnuAnchor(fix.antenna).geodetic(by); }

}  // namespace

TEST_CASE("a drive from standing ends aligned, valid and near the truth") {
  const Final f = drive_it(drive(), test::Samples(drive()));
  CHECK(f.status.phase == AlignmentPhase::kDone);
  CHECK(f.output.odometry.validity == Validity::kValid);
  CHECK(f.output.reason.empty());
  CHECK(f.error.head<2>().norm() < 0.1);
  CHECK(f.error.segment<3>(3).norm() < 0.02);
}

TEST_CASE("the covariance is symmetric to the bit and positive definite") {
  const Final f = drive_it(drive(), test::Samples(drive()));
  const ErrorMatrix P = f.core->covariance();
  CHECK(P == P.transpose());
  // States with a certain value (latencies without a sigma) have zero rows; the others must be definite.
  CHECK((P + 1e-15 * ErrorMatrix::Identity()).llt().info() == Eigen::Success);
}

TEST_CASE("a gated fix leaves the same bits as no fix") {
  test::Samples spiked(drive()), without(drive());
  const size_t i = fix_at(spiked, 50.0);
  move(spiked.gnss[i], {20.0, 0.0, 0.0});
  without.gnss.erase(without.gnss.begin() + static_cast<ptrdiff_t>(i));
  spiked.gnss[i].velocity.reset();
  const Final a = drive_it(drive(), spiked), b = drive_it(drive(), without);
  CHECK(a.gated == b.gated + 1);
  CHECK(same_bits(*a.core, *b.core));
  // Teeth: a fix that passes the gate changes them.
  CHECK_FALSE(same_bits(*a.core, *drive_it(drive(), test::Samples(drive())).core));
}

TEST_CASE("a snapshot continues to the same bits") {
  test::Samples samples(drive());
  move(samples.gnss[fix_at(samples, 52.0)], {20.0, 0.0, 0.0});  // so that a refusal is among what goes on
  for (const double share : {0.05, 0.12, 0.5}) {                // before, while and after it aligns
    CAPTURE(share);
    GnssIns whole(test::filter_config(drive().config)), resumed(test::filter_config(drive().config));
    test::Feeder feeder(samples);
    for (auto left = static_cast<size_t>(share * static_cast<double>(samples.imu.size())); left > 0; --left) {
      feeder.step(whole);
      (void)whole.output();
    }
    const std::vector<uint8_t> snapshot = whole.save();
    resumed.load(snapshot);
    CHECK(resumed.save() == snapshot);
    CHECK_THROWS(GnssIns(test::filter_config(drive().config)).load(std::span(snapshot).first(snapshot.size() / 2)));
    whole.clear_records();
    bool same = true, same_records = true;
    for (test::Feeder other = feeder; feeder.step(whole) && other.step(resumed);) {
      const GnssInsOutput a = whole.output(), b = resumed.output();
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
  test::Samples shifted(drive());
  constexpr int64_t kShift = 86'400'000'000;
  for (ImuSample& s : shifted.imu) s.t_us += kShift;
  for (GnssFix& s : shifted.gnss) s.t_us += kShift;
  for (WheelSample& s : shifted.wheels) s.t_us += kShift;
  GnssIns filter(test::filter_config(drive().config));
  test::run(filter, shifted, [](GnssIns&, int64_t) {});
  const Final f = drive_it(drive(), test::Samples(drive()));
  CHECK(local(f.core->state(), filter.core()->state()).isZero(0.0));
}

TEST_CASE("NaN samples and wild readings are counted and survived") {
  test::Samples s(drive());
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
  test::Samples s(drive());
  s.imu.erase(s.imu.begin() + 4000, s.imu.begin() + 4200);
  const Final f = drive_it(drive(), s);
  CHECK(f.status.imu_gaps == 1);
  CHECK(f.output.odometry.validity == Validity::kValid);
  CHECK(f.error.head<2>().norm() < 0.3);
}

TEST_CASE("a time that runs backwards is refused") {
  GnssIns filter(test::filter_config(drive().config));
  const test::Samples s(drive());
  CHECK(filter.see(s.imu[1]) == InputStatus::kAccepted);
  CHECK(filter.see(s.imu[0]) == InputStatus::kOutOfOrder);
  CHECK(filter.see(s.imu[1]) == InputStatus::kOutOfOrder);
}

TEST_CASE("a frozen IMU is said and does not drag the pose away") {
  test::Samples s(drive());
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
  test::Samples s(drive());
  for (size_t i = fix_at(s, 48.0); i < s.gnss.size(); ++i) move(s.gnss[i], {0.0, 0.0, 40.0});
  const Final f = drive_it(drive(), s);
  CHECK(f.error.head<2>().norm() < 0.2);
  CHECK(f.output.reason == "the height of GNSS contradicts and is not used");
  CHECK(f.status.gnss_reason == f.output.reason);
  CHECK(f.output.reset_counter == 0);
  CHECK(drive_it(drive(), test::Samples(drive())).output.reason.empty());
}

TEST_CASE("a height that stays another one is taken in the end, as a reset of the height alone") {
  test::Samples s(drive());
  for (size_t i = fix_at(s, 40.0); i < s.gnss.size(); ++i) move(s.gnss[i], {0.0, 0.0, 40.0});
  GnssInsConfig config = test::filter_config(drive().config);
  config.alignment.jump_s = 10.0;
  GnssIns filter(config);
  test::run(filter, s, [](GnssIns& f, int64_t) { f.clear_records(); });
  const GnssInsOutput o = filter.output();
  const Eigen::Matrix<double, 9, 1> e = test::error_of(filter, o.odometry, drive());
  CHECK(o.reason.empty());
  CHECK(o.reset_counter == 1);
  CHECK(std::abs(o.reset_delta.p.z() - 40.0) < 1.0);
  CHECK(o.reset_delta.p.head<2>().norm() < 0.1);
  CHECK(std::abs(e(2) + 40.0) < 0.5);
  CHECK(e.head<2>().norm() < 0.2);
}

TEST_CASE("a fix of a kilometre's sigma has no effect") {
  test::Samples s(drive()), without(drive());
  const size_t i = fix_at(s, 50.0);
  without.gnss.erase(without.gnss.begin() + static_cast<ptrdiff_t>(i));
  const auto end_of = [&](const test::Samples& samples) {
    GnssInsConfig config = test::filter_config(drive().config);
    config.screen.max_sigma_m = 1e7;  // it must come through to the update
    GnssIns filter(config);
    int used = 0;
    NavState soon;  // half a second after that fix
    test::run(filter, samples, [&](GnssIns& f, int64_t now) {
      if (seconds_between(s.gnss[i].t_us, now) < 0.75) soon = f.core() == nullptr ? NavState() : f.core()->state();
      for (const AidingRecord& r : f.records())
        used +=
            r.t_us == s.gnss[i].t_us && r.source == AidingSource::kGnssPosition && r.status == AidingStatus::kAccepted;
      f.clear_records();
    });
    return std::pair(soon, used);
  };
  const auto [reference, none] = end_of(without);
  CHECK(none == 0);
  s.gnss[i].velocity.reset();
  s.gnss[i].cov_enu = 1e6 * Eigen::Matrix3d::Identity();
  const auto [state, used] = end_of(s);
  CHECK(used == 1);
  // Not the same bits: the covariance step is split where it is used.
  CHECK(local(reference, state).norm() < 1e-5);
  // Teeth: with a sigma of five centimetres it has one.
  s.gnss[i].cov_enu = 2.5e-3 * Eigen::Matrix3d::Identity();
  CHECK(local(reference, end_of(s).first).norm() > 1e-4);
}

TEST_CASE("a covariance that is not finite is refused and leaves the same bits as no fix") {
  test::Samples s(drive()), without(drive());
  const size_t i = fix_at(s, 50.0);
  s.gnss[i].cov_enu.setConstant(std::numeric_limits<double>::infinity());
  without.gnss.erase(without.gnss.begin() + static_cast<ptrdiff_t>(i));
  CHECK(same_bits(*drive_it(drive(), s).core, *drive_it(drive(), without).core));
}
