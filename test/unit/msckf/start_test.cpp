// Starts in motion: what the covariance says of the speed and of the levelling must be what they are, at the start and
// a second later.
#include <array>
#include <catch2/catch.hpp>
#include <span>

#include "geometry/so3.h"
#include "msckf/stereo_velocity.h"
#include "simulation/random.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr uint64_t kDrives = 6;
constexpr double kLaterUs = 1e6;

/// Squared errors over their variances, per component, at the first running picture and a second later.
struct Started {
  double velocity = 0.0, levelling = 0.0, later = 0.0;
  double widest = 0.0;  ///< m/s, largest sigma of a forward speed at the start
  int starts = 0;
};

double square(const Eigen::Vector3d& e, const Eigen::Matrix3d& P) { return e.dot(P.inverse() * e) / 3.0; }

/// The city's drives with the pictures before their first turn taken away: no wheels, no INS.
Started start_in_turns(double sigma_share) {
  Started sum;
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    const test::VisualDriveConfig car = test::city_drive(40.0);
    test::VisualDrive drive = test::make_drive(car, seed);
    const auto turning = [&](const msckf::SeenFrame& f) {
      const Odometry truth = drive.drive.truth_at(f.t_us);
      return truth.velocity.x() > 3.0 && std::abs(truth.angular_rate.z()) > 0.12;
    };
    const auto first = std::find_if(drive.frames.begin(), drive.frames.end(), turning);
    if (first == drive.frames.end()) continue;
    drive.frames.erase(drive.frames.begin(), first);
    Msckf filter(test::filter_config(car));
    std::optional<int64_t> begun_us;
    bool later = false;
    test::run(filter, drive, false, [&](const Msckf& f) {
      if (later) return;
      const MsckfOutput o = f.output();
      if (o.phase != MsckfPhase::kRunning || o.reset_counter != 0) return;
      const Odometry truth = drive.drive.truth_at(o.odometry.t_us);
      const Eigen::Vector3d e = o.odometry.velocity - truth.velocity;
      const Eigen::Matrix3d P = sigma_share * sigma_share * o.odometry.cov_velocity;
      if (!begun_us) {
        begun_us = o.odometry.t_us;
        ++sum.starts;
        sum.velocity += square(e, P);
        sum.widest = std::max(sum.widest, std::sqrt(P(0, 0)));
        const Eigen::Vector3d up = o.odometry.T_frame_vehicle.q.conjugate() * Eigen::Vector3d::UnitZ();
        const Eigen::Vector3d true_up = truth.T_frame_vehicle.q.conjugate() * Eigen::Vector3d::UnitZ();
        const Eigen::Vector2d tilt = up.cross(true_up).head<2>();
        const Eigen::Matrix2d T = sigma_share * sigma_share * o.odometry.cov_pose.block<2, 2>(3, 3);
        sum.levelling += tilt.dot(T.inverse() * tilt) / 2.0;
      } else if (static_cast<double>(o.odometry.t_us - *begun_us) > kLaterUs) {
        sum.later += square(e, P);
        later = true;
      }
    });
  }
  std::printf(
      "starts in turns, sigma x %.2f: velocity %.3f levelling %.3f, a second later %.3f (%d starts, to %.2f m/s)\n",
      sigma_share, sum.velocity / sum.starts, sum.levelling / sum.starts, sum.later / sum.starts, sum.starts,
      sum.widest);
  return sum;
}

/// A city's drive of which all before `begin_s` is missing.
test::VisualDrive begun_late(const test::VisualDriveConfig& car, uint64_t seed, double begin_s, double end_s) {
  test::VisualDrive d = test::make_drive(car, seed);
  const int64_t start = d.drive.imu.front().t_us;
  const auto cut = [&](auto& samples) {
    std::erase_if(samples, [&](const auto& s) {
      const double t = seconds_between(start, s.t_us);
      return t < begin_s || t > end_s;
    });
  };
  cut(d.drive.imu);
  cut(d.drive.wheels);
  cut(d.frames);
  return d;
}

// Straight on at constant speed, pulling away, braking to a stop: nowhere a turn. One eye alone needs the braking.
constexpr std::array kStraightOn{8.0, 14.0, 26.0, 32.0};
constexpr std::array kBraking{14.0, 26.0};
constexpr double kWatched = 3.0, kWatchedAlone = 6.5;  // s, too short for the next turn

enum class Told { kByWheels, kByEyes, kByNothing };

struct Late {
  double slowest = 0.0;  ///< s, longest time to the first valid pose
  double velocity = 0.0, levelling = 0.0;
  int drives = 0, started = 0;
};

/// Each drive is judged at its first valid pose.
Late start_straight_on(Told told, double sigma_share) {
  Late sum;
  const bool alone = told == Told::kByNothing, wheels = told == Told::kByWheels;
  const std::span<const double> begins = alone ? std::span<const double>(kBraking) : kStraightOn;
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    for (const double begin_s : begins) {
      test::VisualDriveConfig car = test::city_drive(40.0);
      car.stereo = told == Told::kByEyes;
      const test::VisualDrive d = begun_late(car, seed, begin_s, begin_s + (alone ? kWatchedAlone : kWatched));
      Msckf filter(test::filter_config(car));
      bool begun = false;
      ++sum.drives;
      test::run(filter, d, wheels, [&](const Msckf& f) {
        const MsckfOutput o = f.output();
        if (begun || o.odometry.validity == Validity::kInvalid) return;
        begun = true;
        ++sum.started;
        CHECK(o.scale == (alone ? MsckfScale::kInertial : wheels ? MsckfScale::kWheels : MsckfScale::kStereo));
        sum.slowest = std::max(sum.slowest, seconds_between(d.drive.imu.front().t_us, o.odometry.t_us));
        const Odometry truth = d.drive.truth_at(o.odometry.t_us);
        const double share = sigma_share * sigma_share;
        sum.velocity += square(o.odometry.velocity - truth.velocity, share * o.odometry.cov_velocity);
        const Eigen::Vector3d up = o.odometry.T_frame_vehicle.q.conjugate() * Eigen::Vector3d::UnitZ();
        const Eigen::Vector3d true_up = truth.T_frame_vehicle.q.conjugate() * Eigen::Vector3d::UnitZ();
        const Eigen::Vector2d tilt = up.cross(true_up).head<2>();
        const Eigen::Matrix2d T = share * o.odometry.cov_pose.block<2, 2>(3, 3);
        sum.levelling += tilt.dot(T.inverse() * tilt) / 2.0;
      });
    }
  }
  std::printf("starts straight on, told by %s, sigma x %.2f: %d of %d within %.2f s, velocity %.3f levelling %.3f\n",
              alone    ? "nothing"
              : wheels ? "wheels"
                       : "two eyes",
              sigma_share, sum.started, sum.drives, sum.slowest, sum.velocity / sum.started,
              sum.levelling / sum.started);
  return sum;
}

/// Points before two eyes that move and turn, seen before and now; `false_share` of them are anywhere now.
struct Pair {
  msckf::SeenFrame before, now;
};

constexpr double kPairPx = 500.0, kPairNoise = 0.5, kPair_s = 0.1;
const Eigen::Vector3d kPairVelocity(0.5, -0.3, 14.0), kPairRate(0.02, 0.3, -0.05);
const SE3 kRightEye{Eigen::Quaterniond::Identity(), {0.5, 0.0, 0.0}};

Pair seen_pair(uint64_t seed, double false_share) {
  RandomStream random(seed, 0x57E2);
  Pair out;
  out.before.t_us = 1'000'000;
  out.now.t_us = out.before.t_us + static_cast<int64_t>(1e6 * kPair_s);
  const Eigen::Quaterniond half = exp_q(0.5 * kPair_s * kPairRate);
  const SE3 T_before_now{(half * half).normalized(), half * (kPair_s * kPairVelocity)};
  const auto seen = [&](const Eigen::Vector3d& p) {
    return Eigen::Vector2d(p.head<2>() / p.z() +
                           kPairNoise / kPairPx * Eigen::Vector2d(random.normal(), random.normal()));
  };
  for (int64_t track = 0; track < 100; ++track) {
    const double z = 6.0 + 44.0 * random.uniform();
    const Eigen::Vector3d p(z * (1.2 * random.uniform() - 0.6), z * (0.6 * random.uniform() - 0.3), z);
    msckf::SeenPoint before{track, seen(p), seen(kRightEye.inverse() * p), kPairPx}, now{track, {}, {}, kPairPx};
    now.left = seen(T_before_now.inverse() * p);
    if (random.uniform() < false_share) now.left = {random.uniform() - 0.5, 0.5 * random.uniform() - 0.25};
    out.before.points.push_back(before);
    out.now.points.push_back(now);
  }
  return out;
}

}  // namespace

TEST_CASE("two eyes' velocity is what it is, with a third of the points false, and half of them are too many") {
  constexpr int kPairs = 50;
  for (const double false_share : {0.0, 0.3}) {
    double sum = 0.0;
    for (uint64_t seed = 1; seed <= kPairs; ++seed) {
      const Pair pair = seen_pair(seed, false_share);
      const auto seen = msckf::stereo_velocity(pair.before, pair.now, kRightEye, kPairNoise);
      REQUIRE(seen);
      CHECK((seen->rate - kPairRate).norm() < 0.03);
      CHECK((seen->velocity - kPairVelocity).norm() < 1.5);
      sum += square(seen->velocity - kPairVelocity, seen->cov);
    }
    std::printf("two eyes' velocity, %.0f %% false: NEES %.2f\n", 100.0 * false_share, sum / kPairs);
    CHECK(sum / kPairs < 2.0);
    CHECK(sum / kPairs > 0.3);
  }
  const Pair wrong = seen_pair(1, 0.7);
  CHECK(!msckf::stereo_velocity(wrong.before, wrong.now, kRightEye, kPairNoise));
  Pair one_eyed = seen_pair(1, 0.0);
  for (msckf::SeenPoint& p : one_eyed.before.points) p.right.reset();
  CHECK(!msckf::stereo_velocity(one_eyed.before, one_eyed.now, kRightEye, kPairNoise));
}

TEST_CASE("two eyes, and wheels, begin in motion within two seconds, no turn needed, and know how little they know") {
  for (const Told told : {Told::kByEyes, Told::kByWheels}) {
    const Late s = start_straight_on(told, 1.0);
    CHECK(s.started == s.drives);
    CHECK(s.slowest < 1.6);
    CHECK(s.velocity / s.started < 1.5);
    CHECK(s.levelling / s.started < 1.7);
    const Late bold = start_straight_on(told, 0.5);
    CHECK(bold.velocity / bold.started > 1.5);
    CHECK(bold.levelling / bold.started > 1.7);
  }
}

TEST_CASE("one eye alone begins where a car brakes, no turn needed, and knows how little it knows") {
  const Late s = start_straight_on(Told::kByNothing, 1.0);
  CHECK(s.started == s.drives);
  CHECK(s.velocity / s.started < 1.7);
  CHECK(s.levelling / s.started < 1.7);
  const Late bold = start_straight_on(Told::kByNothing, 0.5);
  CHECK(bold.velocity / bold.started > 1.7);
  CHECK(bold.levelling / bold.started > 1.7);
}

TEST_CASE("one eye alone on a straight road at constant speed waits: nothing tells the scale") {
  test::VisualDriveConfig car = test::turn_drive();
  const test::VisualDrive d = begun_late(car, 1, 20.0, 50.0);
  Msckf filter(test::filter_config(car));
  test::run(filter, d, false, [](const Msckf&) {});
  CHECK(filter.output().odometry.validity == Validity::kInvalid);
  CHECK(filter.output().reason.find("scale") != std::string::npos);
}

TEST_CASE("a start in motion goes on from a snapshot to the same bits") {
  const bool stereo = GENERATE(true, false);  // eyes watched, a start planned, running; the last seconds kept, running
  test::VisualDriveConfig car = test::city_drive(40.0);
  car.stereo = stereo;
  const test::VisualDrive d = begun_late(car, 2, 26.0, stereo ? 28.0 : 31.0);
  const int64_t every_us = stereo ? 250'000 : 900'000;
  Msckf whole(test::filter_config(car));
  std::vector<std::vector<uint8_t>> snapshots;
  std::vector<int64_t> when;
  test::run(whole, d, false, [&](const Msckf& f) {
    const int64_t t_us = f.output().odometry.t_us;
    if (t_us - d.drive.imu.front().t_us < every_us * static_cast<int64_t>(1 + when.size())) return;
    snapshots.push_back(f.save());
    when.push_back(t_us);
  });
  REQUIRE(when.size() >= 5);
  REQUIRE(whole.state() != nullptr);
  Digest expected;
  whole.digest(expected);
  for (size_t i = 0; i < 5; ++i) {
    Msckf resumed(test::filter_config(car));
    resumed.load(snapshots[i]);
    test::VisualDrive rest = d;
    std::erase_if(rest.drive.imu, [&](const ImuSample& s) { return s.t_us <= when[i]; });
    std::erase_if(rest.frames, [&](const msckf::SeenFrame& f) { return f.t_us <= when[i]; });
    test::run(resumed, rest, false, [](const Msckf&) {});
    Digest digest;
    resumed.digest(digest);
    CHECK(digest.value() == expected.value());
  }
}

TEST_CASE("a start in a turn knows how little it knows") {
  const Started s = start_in_turns(1.0);
  REQUIRE(s.starts >= 4);
  CHECK(s.velocity / s.starts < 2.0);
  CHECK(s.levelling / s.starts < 2.0);
  CHECK(s.later / s.starts < 2.0);
  CHECK(s.widest < 5.0);  // not by knowing nothing
}

TEST_CASE("the test of starts in turns sees sigmas that are too small") {
  const Started s = start_in_turns(0.2);
  CHECK(s.levelling / s.starts > 2.0);
  CHECK(s.velocity / s.starts > 2.0);
  CHECK(s.later / s.starts > 2.0);
}

TEST_CASE("a start in motion says whose speed it took") {
  test::VisualDriveConfig car = test::highway_drive(8.0);
  car.scenario.motion.route = RouteKind::kColdStartMoving;
  const test::VisualDrive drive = test::make_drive(car, 3);
  for (const bool wheels : {false, true}) {
    Msckf filter(test::filter_config(car));
    std::optional<MsckfScale> first;
    test::run(filter, drive, wheels, [&](const Msckf& f) {
      const int64_t now = f.output().odometry.t_us;
      if (!wheels && !first) filter.add_speed(now, drive.drive.truth_at(now).velocity.x(), 0.2);
      if (!first && f.state() != nullptr) first = f.output().scale;
    });
    REQUIRE(first);
    CHECK(*first == (wheels ? MsckfScale::kWheels : MsckfScale::kIns));
  }
}
