// Fixes of the receivers' drivers that ROS knows, each type with its own units.
#include <cmath>
#include <map>

#include "geometry/frames.h"
#include "roadfix/import/ros_topic.h"

namespace roadfix {
namespace {

// Where a driver does not know its covariance: a receiver alone, in the open.
constexpr double kUnknownHorizontal = 5.0;  // m
constexpr double kUnknownVertical = 10.0;   // m

Eigen::Matrix3d diagonal(double east, double north, double up) {
  return Eigen::Vector3d(east * east, north * north, up * up).asDiagonal();
}

double wrapped(double longitude) { return longitude >= kPi ? longitude - 2.0 * kPi : longitude; }

}  // namespace

void RosTopic::add_fix(GnssFix fix) {
  const Geodetic& place = fix.antenna;
  const bool on_earth = std::abs(place.latitude) <= kPi / 2.0 && std::abs(place.longitude) <= kPi + 1e-9 &&
                        std::isfinite(place.height) && std::abs(place.height) < 20000.0;
  if (!on_earth || fix.fix_type == FixType::kNone) {
    ++left_out;
    return;
  }
  if (!fix.cov_enu.allFinite() || !(fix.cov_enu.diagonal().minCoeff() > 0.0)) {
    ++without_covariance;
    fix.cov_enu = diagonal(kUnknownHorizontal, kUnknownHorizontal, kUnknownVertical);
  }
  if (fix.velocity && !fix.velocity->enu.allFinite()) fix.velocity.reset();
  fix.antenna.longitude = wrapped(place.longitude);
  gnss.push_back(fix);
}

void RosTopic::take_nav_sat_fix(int64_t t_us) {
  GnssFix fix;
  fix.t_us = t_us;
  const double status = number("status.status");  // -1 none, 0 fix, 1 with SBAS, 2 with GBAS, which drivers say of RTK
  fix.fix_type = status < 0.0    ? FixType::kNone
                 : status == 0.0 ? FixType::kSingle
                 : status == 1.0 ? FixType::kDifferential
                                 : FixType::kRtkFixed;
  fix.height_kind = HeightKind::kEllipsoid;
  fix.antenna = {number("latitude") * kDegree, number("longitude") * kDegree, number("altitude")};
  if (number("position_covariance_type") > 0.0) fix.cov_enu = matrix("position_covariance", 3);
  add_fix(fix);
}

void RosTopic::take_gps_fix(int64_t t_us) {
  GnssFix fix;
  fix.t_us = t_us;
  // As NavSatStatus, and 18 DGPS, 19 RTK fixed, 20 RTK float, 33 WAAS.
  static const std::map<int, FixType> kTypes = {
      {0, FixType::kSingle}, {2, FixType::kRtkFixed}, {19, FixType::kRtkFixed}, {20, FixType::kRtkFloat}};
  const int status = static_cast<int>(number("status.status"));
  const auto type = kTypes.find(status);
  fix.fix_type = status < 0 ? FixType::kNone : type == kTypes.end() ? FixType::kDifferential : type->second;
  fix.height_kind = HeightKind::kUnknown;  // "above reference (e.g., sea level)"
  fix.antenna = {number("latitude") * kDegree, number("longitude") * kDegree, number("altitude")};
  if (number("position_covariance_type") > 0.0) fix.cov_enu = matrix("position_covariance", 3);
  fix.num_satellites = static_cast<int>(number("status.satellites_used"));
  const double pdop = number("pdop"), sigma = number("err_speed");
  if (pdop > 0.0 && std::isfinite(pdop)) fix.pdop = pdop;
  const double course = number("track") * kDegree, speed = number("speed");
  if (speed != 0.0 || course != 0.0) {
    const Eigen::Vector3d enu(speed * std::sin(course), speed * std::cos(course), number("climb"));
    constexpr double kTwoSigma = 2.0;  // err_speed is given at 95 %
    fix.velocity =
        GnssVelocity{enu, Eigen::Matrix3d::Identity() * std::pow(std::isfinite(sigma) ? sigma / kTwoSigma : 0.0, 2)};
  }
  add_fix(fix);
}

/// MAVLink's GPS_RAW_INT: 1e-7 deg, mm; 255 satellites are unknown. Its speed has no sigma and no vertical part: left out.
void RosTopic::take_gps_raw(int64_t t_us) {
  GnssFix fix;
  fix.t_us = t_us;
  static constexpr FixType kTypes[] = {FixType::kNone,         FixType::kNone,     FixType::kSingle,  FixType::kSingle,
                                       FixType::kDifferential, FixType::kRtkFloat, FixType::kRtkFixed};
  const double type = number("fix_type");
  fix.fix_type = type >= 0.0 && type <= 6.0 ? kTypes[static_cast<std::size_t>(type)] : FixType::kSingle;
  const bool ellipsoid = has("alt_ellipsoid") && number("alt_ellipsoid") != 0.0;
  fix.height_kind = ellipsoid ? HeightKind::kEllipsoid : HeightKind::kMeanSeaLevel;
  fix.antenna = {number("lat") * 1e-7 * kDegree, number("lon") * 1e-7 * kDegree,
                 number(ellipsoid ? "alt_ellipsoid" : "alt") * 1e-3};
  if (has("h_acc") && number("h_acc") > 0.0) {
    const double h = number("h_acc") * 1e-3 / std::sqrt(2.0);
    fix.cov_enu = diagonal(h, h, number("v_acc") * 1e-3);
  }
  constexpr double kUnknownSatellites = 255.0;
  if (number("satellites_visible") < kUnknownSatellites) {
    fix.num_satellites = static_cast<int>(number("satellites_visible"));
  }
  add_fix(fix);
}

/// u-blox UBX-NAV-PVT: 1e-7 deg, mm, mm/s. ROS 2 calls fix_type what ROS 1 called fixType, and so on.
void RosTopic::take_nav_pvt(int64_t t_us) {
  const bool ros2 = has("fix_type");
  const auto field = [&](const char* ros1_name, const char* ros2_name) { return number(ros2 ? ros2_name : ros1_name); };
  GnssFix fix;
  fix.t_us = t_us;
  const auto flags = static_cast<unsigned>(number("flags"));
  // 0 none, 1 dead reckoning, 2 2D, 3 3D, 4 with dead reckoning, 5 time alone
  const double type = field("fixType", "fix_type");
  const unsigned carrier = flags >> 6U;  // 1 float, 2 fixed
  fix.fix_type = type == 0.0 || type == 5.0 || (flags & 1U) == 0 ? FixType::kNone
                 : type == 1.0                                   ? FixType::kDeadReckoning
                 : carrier == 2                                  ? FixType::kRtkFixed
                 : carrier == 1                                  ? FixType::kRtkFloat
                 : (flags & 2U) != 0                             ? FixType::kDifferential
                                                                 : FixType::kSingle;
  fix.height_kind = HeightKind::kEllipsoid;
  fix.antenna = {number("lat") * 1e-7 * kDegree, number("lon") * 1e-7 * kDegree, number("height") * 1e-3};
  // The accuracy is of the distance, each axis has its part.
  const double h = field("hAcc", "h_acc") * 1e-3 / std::sqrt(2.0);
  fix.cov_enu = diagonal(h, h, field("vAcc", "v_acc") * 1e-3);
  const Eigen::Vector3d enu(field("velE", "vel_e"), field("velN", "vel_n"), -field("velD", "vel_d"));
  const double sigma = field("sAcc", "s_acc") * 1e-3;
  fix.velocity = GnssVelocity{enu * 1e-3, Eigen::Matrix3d::Identity() * sigma * sigma};
  fix.num_satellites = static_cast<int>(field("numSV", "num_sv"));
  fix.pdop = field("pDOP", "p_dop") * 0.01;
  add_fix(fix);
}

}  // namespace roadfix
