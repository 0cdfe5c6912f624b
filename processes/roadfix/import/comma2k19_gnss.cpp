#include "roadfix/import/comma2k19_gnss.h"

#include <cmath>

#include "geometry/frames.h"

namespace roadfix {
namespace {

/// The receiver's UTC, which the dataset has in milliseconds though its description says seconds; empty where it is
/// none: not ascending, or far from when its message arrived.
std::vector<int64_t> epochs(const CommaLog& log) {
  constexpr double kMilliseconds = 1e11;     // as seconds, the year 5138
  constexpr int64_t kLatest_us = 2'000'000;  // between a fix and its message
  std::vector<int64_t> epochs_us;
  for (std::size_t i = 0; i < log.rows.size(); ++i) {
    const double utc = log.value.at(log.rows[i], 3);
    if (!(utc > 0.0 && utc < 1e14)) return {};
    const int64_t t_us = std::llround(utc * (utc > kMilliseconds ? 1e3 : 1e6));
    const bool ascends = epochs_us.empty() || t_us > epochs_us.back();
    if (!ascends || std::abs(t_us - log.t_us[i]) > kLatest_us) return {};
    epochs_us.push_back(t_us);
  }
  return epochs_us;
}

GnssFix fix(int64_t t_us, double lat_deg, double lon_deg, double height, double speed, double bearing_deg) {
  constexpr double kPlace = 5.0, kHeight = 10.0;  // m, as for ROS fixes that give none
  constexpr double kSpeed = 0.3, kUp = 10.0;      // m/s; the receiver gives no climb
  GnssFix fix;
  fix.t_us = t_us;
  fix.fix_type = FixType::kSingle;
  fix.height_kind = HeightKind::kUnknown;
  const double longitude = lon_deg * kDegree;
  fix.antenna = {lat_deg * kDegree, longitude >= kPi ? longitude - 2.0 * kPi : longitude, height};
  fix.cov_enu = Eigen::Vector3d(kPlace, kPlace, kHeight).cwiseAbs2().asDiagonal();
  const double course = bearing_deg * kDegree;
  fix.velocity = GnssVelocity{{speed * std::sin(course), speed * std::cos(course), 0.0},
                              Eigen::Vector3d(kSpeed, kSpeed, kUp).cwiseAbs2().asDiagonal()};
  return fix;
}

}  // namespace

CommaFixes comma_fixes(const CommaLog& log) {
  CommaFixes fixes;
  const std::vector<int64_t> epochs_us = epochs(log);
  fixes.at_own_times = !epochs_us.empty();
  for (std::size_t i = 0; i < log.t_us.size(); ++i) {
    const std::size_t row = log.rows[i];
    const auto value = [&](std::size_t column) { return log.value.at(row, column); };
    const bool sane = std::abs(value(0)) <= 90.0 && std::abs(value(1)) <= 180.0 && std::abs(value(2)) <= 150.0 &&
                      value(4) >= -1000.0 && value(4) <= 20000.0;
    if (!sane || (value(0) == 0.0 && value(1) == 0.0)) {
      ++fixes.without_place;
      continue;
    }
    const int64_t t_us = fixes.at_own_times ? epochs_us[i] : log.t_us[i];
    fixes.list.push_back(fix(t_us, value(0), value(1), value(4), value(2), value(5)));
  }
  return fixes;
}

}  // namespace roadfix
