#include "fuzz/device_promises.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <roadfix/gnss_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/types/schema.h"

namespace roadfix::test {

namespace {

template <std::size_t N>
bool within(const double (&values)[N], double limit) {
  for (const double value : values)
    if (!(std::abs(value) <= limit)) return false;
  return true;
}

/// Finite, with variances that are none too small or large.
template <std::size_t N>
bool is_covariance(const double (&m)[N][N], double least, double most) {
  for (std::size_t i = 0; i < N; ++i) {
    if (!(m[i][i] >= least && m[i][i] <= most)) return false;
    for (std::size_t j = 0; j < N; ++j)
      if (!(m[i][j] * m[i][j] <= 1.000001 * m[i][i] * m[j][j])) return false;
  }
  return true;
}

void check(const gnss_t& m) {
  const bool fix = m.fix_type != gnss_t::FIX_NONE;
  promise(m.fix_type >= gnss_t::FIX_NONE && m.fix_type <= gnss_t::FIX_DEAD_RECKONING, "gnss: a type of fix that is");
  promise(m.lat_deg >= -90.0 && m.lat_deg <= 90.0, "gnss: latitude in [-90, 90]");
  promise(m.lon_deg >= -180.0 && m.lon_deg < 180.0, "gnss: longitude in [-180, 180)");
  promise(m.height_m >= -1000.0 && m.height_m <= 20000.0, "gnss: a height of this world");
  promise(is_covariance(m.cov_enu_m2, fix ? 1e-300 : 0.0, 1.1e14), "gnss: a covariance of the position");
  if (m.has_velocity) {
    promise(fix, "gnss: no velocity without a fix");
    promise(within(m.velocity_enu_mps, 1000.0), "gnss: a speed of this world");
    promise(is_covariance(m.cov_velocity_enu_m2ps2, 1e-300, 1.1e14), "gnss: a covariance of the velocity");
  }
  if (m.has_heading) {
    promise(m.heading_deg >= 0.0 && m.heading_deg < 360.0, "gnss: heading in [0, 360)");
    promise(m.heading_std_deg > 0.0 && m.heading_std_deg <= 180.001, "gnss: a sigma of the heading");
  }
  promise(m.num_satellites >= 0, "gnss: a number of satellites");
  promise(m.pdop >= 0.0 && m.pdop <= 1e4, "gnss: a dilution of precision");
  promise(m.correction_age_s >= 0.0 && m.correction_age_s <= 1e6, "gnss: an age of the corrections");
}

void check(const imu_t& m) {
  promise(within(m.gyro_radps, 200.0), "imu: rates that the format can hold");
  promise(within(m.accel_mps2, 2048.0), "imu: accelerations that the format can hold");
}

void check(const wheels_t& m) {
  promise(m.num_speeds == 1 || m.num_speeds == 4, "wheels: one speed, or four");
  promise(within(m.speed_mps, 1000.0), "wheels: speeds within the largest that can be configured");
  for (const double speed : m.speed_mps)
    promise(m.direction == wheels_t::DIRECTION_SIGNED || speed >= 0.0, "wheels: magnitudes are not negative");
  promise(std::abs(m.yaw_rate_radps) <= 1000.0, "wheels: a yaw rate within the largest that can be configured");
}

void check(const pose_t& m) {
  double norm = 0.0;
  for (const double q : m.q_wxyz) norm += q * q;
  promise(std::abs(norm - 1.0) < 1e-6, "pose: a unit quaternion");
  promise(within(m.position_m, 2e7), "pose: a position on this Earth");
  promise(within(m.velocity_mps, 2000.0), "pose: a speed of this world");
  promise(is_covariance(m.cov_pose_m2_rad2, 1e-300, 1.1e14), "pose: a covariance");
  promise(is_covariance(m.cov_velocity_m2ps2, 1e-300, 1.1e14), "pose: a covariance of the velocity");
  promise(std::abs(m.anchor_lat_deg) <= 90.0 && std::abs(m.anchor_lon_deg) <= 180.0, "pose: an anchor on this Earth");
}

template <class T>
void decode_and_check(std::span<const uint8_t> bytes) {
  static const MessageCheck kCheck = Schema::built_in().check_of(T::getTypeName());
  promise(kCheck(bytes) == CheckResult::kOk, "a message of its type");
  check(decode<T>(bytes));
}

}  // namespace

void promise(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", what);
  std::abort();
}

void PromisedOutputs::send(const std::string& channel, int64_t utime, std::span<const uint8_t> bytes) {
  if (channel == "GNSS") decode_and_check<gnss_t>(bytes);
  if (channel == "IMU") decode_and_check<imu_t>(bytes);
  if (channel == "WHEELS") decode_and_check<wheels_t>(bytes);
  if (channel == "REFERENCE") decode_and_check<pose_t>(bytes);
  promise(utime <= latest_utime_, "no message is from the future");
  sent_[channel].emplace_back(bytes.begin(), bytes.end());
}

}  // namespace roadfix::test
