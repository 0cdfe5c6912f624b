#include "roadfix/import/imu_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr double kGravity = 9.81;        // m/s2
constexpr std::size_t kFewSamples = 50;  // fewer have no mean worth the name

struct Course {
  int64_t t_us = 0;
  double angle = 0.0;  ///< rad, counterclockwise from east
};

/// Where the vehicle went, as far as it was fast enough for its course to be one.
class CourseList {
 public:
  void add(int64_t t_us, const Eigen::Vector3d& velocity_enu) {
    constexpr double kFast = 3.0;  // m/s; a receiver's 0.1 m/s is then 2 deg
    if (velocity_enu.head<2>().norm() < kFast) return;
    if (!list_.empty() && t_us <= list_.back().t_us) return;
    list_.push_back({t_us, std::atan2(velocity_enu.y(), velocity_enu.x())});
  }
  [[nodiscard]] const std::vector<Course>& list() const { return list_; }

 private:
  std::vector<Course> list_;
};

/// Of the fixes' velocities; without these of their places; without fixes of the reference's velocities.
std::vector<Course> courses(const Drive& drive) {
  CourseList courses;
  const bool has_velocity =
      std::any_of(drive.gnss.begin(), drive.gnss.end(), [](const GnssFix& fix) { return fix.velocity.has_value(); });
  if (has_velocity) {
    for (const GnssFix& fix : drive.gnss) {
      if (fix.velocity) courses.add(fix.t_us, fix.velocity->enu);
    }
  } else if (!drive.gnss.empty()) {
    constexpr double kApart = 0.9;  // s; nearer places have no course, in farther ones it turns
    const EnuAnchor anchor(drive.gnss.front().antenna);
    const GnssFix* before = &drive.gnss.front();
    for (const GnssFix& fix : drive.gnss) {
      const double dt_s = seconds_between(before->t_us, fix.t_us);
      if (dt_s < kApart) continue;
      if (dt_s < 2.0 * kApart + 0.3) {
        courses.add(before->t_us + (fix.t_us - before->t_us) / 2,
                    (anchor.enu(fix.antenna) - anchor.enu(before->antenna)) / dt_s);
      }
      before = &fix;
    }
  } else {
    for (const ReferencePoint& point : drive.reference) {
      if (point.velocity_enu) courses.add(point.t_us, *point.velocity_enu);
    }
  }
  return courses.list();
}

/// The angle about `up` that the gyro's samples add up to, at any time between them.
class TurnOfGyro {
 public:
  TurnOfGyro(const std::vector<ImuSample>& imu, const Eigen::Vector3d& up) {
    for (const ImuSample& sample : imu) {
      const double dt_s = t_us_.empty() ? 0.0 : seconds_between(t_us_.back(), sample.t_us);
      if (!t_us_.empty() && dt_s <= 0.0) continue;
      angle_.push_back((angle_.empty() ? 0.0 : angle_.back()) + dt_s * up.dot(sample.gyro));
      t_us_.push_back(sample.t_us);
    }
  }
  /// From a to b; nothing where the samples do not reach, or have a gap there.
  [[nodiscard]] std::optional<double> between(int64_t a_us, int64_t b_us) const {
    constexpr double kGap = 0.5;  // s
    const auto first = std::lower_bound(t_us_.begin(), t_us_.end(), a_us);
    const auto last = std::lower_bound(t_us_.begin(), t_us_.end(), b_us);
    if (first == t_us_.begin() || last == t_us_.end()) return std::nullopt;
    for (auto t = first - 1; t != last; ++t) {
      if (seconds_between(*t, *(t + 1)) > kGap) return std::nullopt;
    }
    return at(last, b_us) - at(first, a_us);
  }

 private:
  [[nodiscard]] double at(std::vector<int64_t>::const_iterator behind, int64_t t_us) const {
    const auto i = static_cast<std::size_t>(behind - t_us_.begin());
    const double part = seconds_between(t_us_[i - 1], t_us) / seconds_between(t_us_[i - 1], t_us_[i]);
    return angle_[i - 1] + part * (angle_[i] - angle_[i - 1]);
  }

  std::vector<int64_t> t_us_;
  std::vector<double> angle_;
};

/// How much the gyro turns where the course turns by 1; nothing where the drive has too few turns, or the two have
/// nothing to do with each other. A gyro's bias is no part of it.
std::optional<double> gyro_per_course(const Drive& drive, const Eigen::Vector3d& up) {
  const std::vector<Course> course = courses(drive);
  const TurnOfGyro gyro(drive.imu, up);
  std::vector<Eigen::Vector2d> turns;  // course, gyro
  for (std::size_t i = 0, k = 0; i < course.size(); i = k) {
    for (k = i + 1; k < course.size() && seconds_between(course[i].t_us, course[k].t_us) < 1.0;) ++k;
    if (k >= course.size() || seconds_between(course[i].t_us, course[k].t_us) > 2.5) continue;
    const auto turned = gyro.between(course[i].t_us, course[k].t_us);
    if (turned) turns.emplace_back(wrap_angle(course[k].angle - course[i].angle), *turned);
  }
  constexpr std::size_t kFewTurns = 10;
  constexpr double kLittle = 0.5 * kPi;  // rad of turning in all
  constexpr double kRelated = 0.9;       // correlation
  if (turns.size() < kFewTurns) return std::nullopt;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& turn : turns) mean += turn / static_cast<double>(turns.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  double all = 0.0;
  for (const Eigen::Vector2d& turn : turns) {
    scatter += (turn - mean) * (turn - mean).transpose();
    all += std::abs(turn.x() - mean.x());
  }
  const double correlation = scatter(0, 1) / std::sqrt(scatter(0, 0) * scatter(1, 1));
  if (all < kLittle || !(std::abs(correlation) > kRelated)) return std::nullopt;
  return scatter(0, 1) / scatter(0, 0);
}

void check_length(double mean, std::vector<std::string>& remarks) {
  if (mean > 8.0 && mean < 12.0) return;
  const bool looks_like_g = mean > 0.8 && mean < 1.2;
  remarks.push_back(
      fmt::format("imu: the mean acceleration is {:.3g} where gravity makes it {} m/s2: {}", mean, kGravity,
                  looks_like_g ? "it looks like g; a drive folder's columns are then accel_x_g, accel_y_g, accel_z_g"
                               : "is it in m/s2, and is gravity in it?"));
}

void check_axes(const Drive& drive, const Eigen::Vector3d& up, bool turns_against, std::vector<std::string>& remarks) {
  const auto& mounting = drive.description.calibration.mounting;
  Eigen::Vector3d in_vehicle = up;
  double std_deg = 0.0;
  if (mounting && mounting->angles_deg) {
    const Eigen::Vector3d angles = kDegree * *mounting->angles_deg;
    in_vehicle = quaternion({angles.z(), angles.y(), angles.x()}) * up;
  }
  if (mounting && mounting->std_deg) std_deg = mounting->std_deg->head<2>().maxCoeff();
  constexpr double kSlope_deg = 20.0;  // no drive's mean slope, and a mounting that nobody would call level
  const double tilt_deg = std::acos(std::clamp(in_vehicle.z(), -1.0, 1.0)) / kDegree;
  if (tilt_deg <= kSlope_deg + 3.0 * std_deg) return;
  const std::string seen = fmt::format("imu: gravity is seen along ({:.2f}, {:.2f}, {:.2f}) where (0, 0, 1) is up",
                                       in_vehicle.x(), in_vehicle.y(), in_vehicle.z());
  if (tilt_deg < 180.0 - kSlope_deg) {
    remarks.push_back(fmt::format(
        "{}: {:.0f} deg off; set mounting.angles_deg, or mounting.std_deg as wide as it is unknown", seen, tilt_deg));
  } else if (turns_against) {
    remarks.push_back(seen +
                      ", but the gyro turns as if z pointed up: the accelerometer's sign is turned; standing level, "
                      "accel_z_mps2 is +9.8");
  } else {
    remarks.push_back(seen +
                      ": the axes look like front-right-down; set mounting.angles_deg: [180, 0, 0], or turn the "
                      "signs of y and z of gyro and accelerometer");
  }
}

void check_ratio(double ratio, bool z_is_down, std::vector<std::string>& remarks) {
  constexpr double kDegreesPerRadian = 180.0 / kPi;
  const double size = std::abs(ratio);
  const std::string seen = fmt::format("imu: the gyro turns {:.3g} times as much as the course of GNSS", ratio);
  if (size > 0.7 * kDegreesPerRadian && size < 1.4 * kDegreesPerRadian) {
    remarks.push_back(
        seen + ": it looks like deg/s; a drive folder's columns are then gyro_x_degps, gyro_y_degps, gyro_z_degps");
  } else if (size < 0.7 || size > 1.4) {
    remarks.push_back(seen + ": is it in rad/s?");
  }
  if (ratio < 0.0 && !z_is_down) {
    remarks.push_back(seen +
                      ": it turns the other way; about the axis that gravity says is up, counterclockwise is positive");
  }
}

}  // namespace

std::vector<std::string> imu_remarks(const Drive& drive) {
  std::vector<std::string> remarks;
  if (drive.imu.size() < kFewSamples) return remarks;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const ImuSample& sample : drive.imu) mean += sample.accel / static_cast<double>(drive.imu.size());
  check_length(mean.norm(), remarks);
  if (!(mean.norm() > 0.5)) return remarks;  // no direction
  const Eigen::Vector3d up = mean.normalized();
  const std::optional<double> ratio = gyro_per_course(drive, up);
  check_axes(drive, up, ratio && *ratio < 0.0, remarks);
  if (ratio) check_ratio(*ratio, up.z() < -0.9, remarks);
  return remarks;
}

}  // namespace roadfix
