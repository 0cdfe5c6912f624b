// A step that was laid to the wrong cause is undone, (N.5.11): places that fit the state as it was before tell.
#include <catch2/catch.hpp>
#include <optional>

#include "navigation/filter.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr double kGateSigma = 5.0;
constexpr double kAccelStep = 0.15;  // m/s2, along the way
constexpr int kFix_us = 250'000;

/// A car that drives straight on at constant speed, with places of 2 cm; its accelerometer reads `bias` too much from the
/// beginning on, which the filter does not estimate until a step of that bias is taken back.
class StraightDrive {
 public:
  explicit StraightDrive(double bias) : bias_(bias), filter_(NavigationConfig(), inertial::Earth(), false) {
    Mean x;
    x.t_us = t_us_;
    x.nav.velocity.x() = kSpeed;
    BaseVector std = BaseVector::Constant(1e-3);
    std.segment<3>(kVel).setConstant(0.02);
    std.segment<3>(kPos).setConstant(0.02);
    filter_.initialise(x, std);
    filter_.watch_for_steps();
  }

  /// Of the accelerometer's bias along the way, a second after it began, as if it were sure.
  void take_back(double size) {
    StepDetector::Step step;
    step.kind = StepKind::kImu;
    step.age = 1.0;
    step.column = StepDetector::first(StepDetector::of_octave(0)) + 1;  // behind the wheels' scale
    step.size = StepDetector::SmallVector::Zero(6);
    step.size(3) = size;
    step.cov = 1e-10 * StepDetector::Small::Identity(6, 6);
    filter_.take_back(step);
  }

  /// The first step that is found within `seconds`.
  std::optional<StepDetector::Step> drive(double seconds) {
    const int64_t end_us = t_us_ + static_cast<int64_t>(1e6 * seconds);
    while (t_us_ < end_us) {
      t_us_ += 10'000;
      const Eigen::Vector3d gravity = inertial::Earth().gravity(filter_.state().x.nav.position);
      filter_.predict({t_us_, Eigen::Vector3d::Zero(), Eigen::Vector3d(bias_, 0.0, gravity.norm())}, 0.01,
                      {1e-4, 1e-3});
      if (t_us_ % kFix_us != 0) continue;
      fix();
      if (auto step = filter_.likely_step(kGateSigma, false, false)) return step;
    }
    return std::nullopt;
  }

  void take_back(const StepDetector::Step& step) { filter_.take_back(step); }
  [[nodiscard]] double along() const { return filter_.state().x.nav.position.x() - truth(); }
  [[nodiscard]] double accel_bias() const { return filter_.state().x.accel_bias.x(); }

 private:
  static constexpr double kSpeed = 10.0;
  [[nodiscard]] double truth() const { return kSpeed * 1e-6 * static_cast<double>(t_us_ - kFix_us); }

  void fix() {
    constexpr double kNoise = 0.02;
    filter_.flush();
    Measurement<3> m;
    m.residual = Eigen::Vector3d(truth(), 0.0, 0.0) - filter_.state().x.nav.position;
    m.H.block<3, 3>(0, kPos).setIdentity();
    m.R = kNoise * kNoise * Eigen::Matrix3d::Identity();
    if (filter_.fuse(AidingSource::kGnssPosition, t_us_, m, kGateSigma * kGateSigma).status != AidingStatus::kAccepted)
      filter_.reject(m);
  }

  double bias_;
  int64_t t_us_ = kFix_us;
  Filter filter_;
};

}  // namespace

TEST_CASE("a step of the imu that was none is undone, and passes for no step of another thing") {
  StraightDrive drive(0.0);
  REQUIRE_FALSE(drive.drive(4.0));
  drive.take_back(kAccelStep);
  CHECK(drive.accel_bias() == Approx(kAccelStep).epsilon(0.1));
  const auto step = drive.drive(6.0);
  REQUIRE(step);
  CHECK(step->kind == StepKind::kNone);
  CHECK(step->size(0) == Approx(-1.0).epsilon(0.2));
  drive.take_back(*step);
  CHECK(std::abs(drive.accel_bias()) < 0.2 * kAccelStep);
  CHECK_FALSE(drive.drive(6.0));
  CHECK(std::abs(drive.along()) < 0.05);
}

TEST_CASE("a step of the imu that there was stays taken back") {
  StraightDrive drive(kAccelStep);
  drive.take_back(kAccelStep);
  CHECK_FALSE(drive.drive(12.0));
  CHECK(drive.accel_bias() == Approx(kAccelStep).epsilon(0.1));
  CHECK(std::abs(drive.along()) < 0.05);
}
