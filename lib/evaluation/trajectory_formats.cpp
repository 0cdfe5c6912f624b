#include "evaluation/trajectory_formats.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "geometry/frames.h"

namespace roadfix {
namespace {

std::string metres(double value) { return fmt::format("{:.9f}", value); }
std::string unit(double value) { return fmt::format("{:.12f}", value); }
std::string degrees(double radians) { return fmt::format("{:.12f}", radians / kDegree); }
std::string number(double value) { return fmt::format("{:.9g}", value); }

constexpr int64_t kMicroseconds = 1'000'000;

/// Division that rounds down, for times before 1970 too.
int64_t floor_divide(int64_t a, int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

std::string seconds(int64_t t_us) { return fmt::format("{}.{:06}", t_us / kMicroseconds, t_us % kMicroseconds); }

struct Date {
  int64_t year, month, day;
};

/// Gregorian date of a day since 1970-01-01 (Howard Hinnant, chrono-compatible low-level date algorithms, 2013:
/// civil_from_days). std::chrono is the clock's header and stays out of this library.
Date date_of(int64_t day) {
  const int64_t shifted = day + 719468;  // days since 0000-03-01
  const int64_t era = floor_divide(shifted, 146097);
  const int64_t day_of_era = shifted - era * 146097;
  const int64_t year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36524 - day_of_era / 146096) / 365;
  const int64_t day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
  const int64_t month_from_march = (5 * day_of_year + 2) / 153;
  const int64_t month = month_from_march < 10 ? month_from_march + 3 : month_from_march - 9;
  return {year_of_era + era * 400 + (month <= 2 ? 1 : 0), month, day_of_year - (153 * month_from_march + 2) / 5 + 1};
}

const char* name_of(Validity validity) {
  switch (validity) {
    case Validity::kInvalid:
      return "invalid";
    case Validity::kCoasting:
      return "coasting";
    case Validity::kValid:
      return "valid";
  }
  return "invalid";
}

}  // namespace

std::string iso_time(int64_t t_us) {
  const int64_t second = floor_divide(t_us, kMicroseconds);
  const int64_t day = floor_divide(second, 86400);
  const int64_t in_day = second - day * 86400;
  const Date date = date_of(day);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:06}Z", date.year, date.month, date.day, in_day / 3600,
                     in_day / 60 % 60, in_day % 60, t_us - second * kMicroseconds);
}

void write_tum(std::ostream& out, const Trajectory& trajectory) {
  for (const Odometry& pose : trajectory.poses) {
    if (pose.validity == Validity::kInvalid) continue;
    const SE3& T = pose.T_frame_vehicle;
    out << seconds(pose.t_us);
    for (int i = 0; i < 3; ++i) out << ' ' << metres(T.p(i));
    for (const double q : {T.q.x(), T.q.y(), T.q.z(), T.q.w()}) out << ' ' << unit(q);
    out << '\n';
  }
}

void write_kitti(std::ostream& out, const Trajectory& trajectory) {
  std::optional<SE3> T_first_frame;
  for (const Odometry& pose : trajectory.poses) {
    if (pose.validity == Validity::kInvalid) continue;
    if (!T_first_frame) T_first_frame = pose.T_frame_vehicle.inverse();
    const SE3 T = *T_first_frame * pose.T_frame_vehicle;
    const Eigen::Matrix3d R = T.R();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) out << unit(R(row, column)) << ' ';
      out << metres(T.p(row)) << (row < 2 ? ' ' : '\n');
    }
  }
}

void write_csv(std::ostream& out, const Trajectory& trajectory, const std::optional<Geodetic>& anchor) {
  out << "utime_us,x_m,y_m,z_m,qw,qx,qy,qz,vel_x_mps,vel_y_mps,vel_z_mps,rate_x_radps,rate_y_radps,rate_z_radps,"
         "std_x_m,std_y_m,std_z_m,std_roll_rad,std_pitch_rad,std_yaw_rad,validity";
  out << (anchor ? ",lat_deg,lon_deg,height_m\n" : "\n");
  std::optional<EnuAnchor> enu;
  if (anchor) enu.emplace(*anchor);
  for (const Odometry& pose : trajectory.poses) {
    const SE3& T = pose.T_frame_vehicle;
    out << pose.t_us;
    for (int i = 0; i < 3; ++i) out << ',' << metres(T.p(i));
    for (const double q : {T.q.w(), T.q.x(), T.q.y(), T.q.z()}) out << ',' << unit(q);
    for (int i = 0; i < 3; ++i) out << ',' << metres(pose.velocity(i));
    for (int i = 0; i < 3; ++i) out << ',' << unit(pose.angular_rate(i));
    for (int i = 0; i < 6; ++i) out << ',' << number(std::sqrt(std::max(0.0, pose.cov_pose(i, i))));
    out << ',' << name_of(pose.validity);
    if (enu) {
      const Geodetic g = enu->geodetic(T.p);
      out << ',' << degrees(g.latitude) << ',' << degrees(g.longitude) << ',' << metres(g.height);
    }
    out << '\n';
  }
}

void write_geojson(std::ostream& out, const Trajectory& trajectory, const Geodetic& anchor, const std::string& name) {
  const EnuAnchor enu(anchor);
  std::string coordinates;
  std::string times;
  for (const Odometry& pose : trajectory.poses) {
    if (pose.validity == Validity::kInvalid) continue;
    const Geodetic g = enu.geodetic(pose.T_frame_vehicle.p);
    if (!coordinates.empty()) {
      coordinates += ",\n";
      times += ", ";
    }
    // RFC 7946: longitude first; nine digits are 0.1 mm.
    coordinates += "[" + fmt::format("{:.9f}", g.longitude / kDegree) + ", " +
                   fmt::format("{:.9f}", g.latitude / kDegree) + ", " + fmt::format("{:.4f}", g.height) + "]";
    times += "\"" + iso_time(pose.t_us) + "\"";
  }
  out << R"({"type": "Feature", "properties": {"name": ")" << name << R"(", "times": [)" << times
      << "]},\n\"geometry\": {\"type\": \"LineString\", \"coordinates\": [\n"
      << coordinates << "]}}\n";
}

}  // namespace roadfix
