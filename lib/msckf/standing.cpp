#include "msckf/standing.h"

#include <algorithm>
#include <cmath>

namespace roadfix::msckf {

namespace {

constexpr size_t kEnoughTracks = 12;
constexpr int64_t kPictureAgeUs = 500'000;
constexpr int64_t kWheelAgeUs = 1'000'000;
constexpr double kShaken = 3.0;
constexpr double kWheelRest = 0.02;  // m/s

}  // namespace

void Standing::add(const ImuSample& imu, double dt) {
  const double elapsed = times_.sum();
  const int quarter = std::min(kQuarters - 1, static_cast<int>(elapsed / trust_.block_s * kQuarters));
  sums_.col(quarter).head<3>() += dt * imu.gyro;
  sums_.col(quarter).tail<3>() += dt * imu.accel;
  times_(quarter) += dt;
  if (elapsed + dt < trust_.block_s - 1e-6) return;
  const double duration = times_.sum();
  block_ = {};
  block_.end_us = imu.t_us;
  block_.gyro = sums_.rowwise().sum().head<3>() / duration;
  block_.accel = sums_.rowwise().sum().tail<3>() / duration;
  block_.gyro_wander = block_.accel_wander = 0.0;
  for (int i = 0; i < kQuarters; ++i) {
    if (times_(i) <= 0.0) continue;
    block_.gyro_wander = std::max(block_.gyro_wander, (sums_.col(i).head<3>() / times_(i) - block_.gyro).norm());
    block_.accel_wander = std::max(block_.accel_wander, (sums_.col(i).tail<3>() / times_(i) - block_.accel).norm());
  }
  sums_.setZero();
  times_.setZero();
}

void Standing::add(const SeenFrame& frame) {
  frame_us_ = frame.t_us;
  moved_.clear();
  auto old = older_.places.begin();
  for (const SeenPoint& point : frame.points) {
    while (old != older_.places.end() && old->track < point.track) ++old;
    if (old != older_.places.end() && old->track == point.track)
      moved_.push_back(point.px * (point.left - old->left).norm());
  }
  flow_.reset();
  if (moved_.size() >= kEnoughTracks) {
    const auto middle = moved_.begin() + static_cast<std::ptrdiff_t>(moved_.size() / 2);
    std::nth_element(moved_.begin(), middle, moved_.end());
    flow_ = *middle;
  }
  const auto half_second = static_cast<int64_t>(1e6 * trust_.block_s);
  if (frame.t_us - newer_.t_us < half_second) return;
  std::swap(older_, newer_);
  newer_.t_us = frame.t_us;
  newer_.places.clear();
  for (const SeenPoint& point : frame.points) newer_.places.push_back({point.track, point.left});
  if (older_.places.empty()) older_ = newer_;
}

void Standing::add_speed(int64_t t_us, double speed) {
  wheels_us_ = t_us;
  wheels_rest_ = std::abs(speed) < kWheelRest;
}

bool Standing::stands(int64_t t_us, std::optional<double> speed) const {
  const bool wheels_known = wheels_us_ != 0 && t_us - wheels_us_ < kWheelAgeUs;
  if (wheels_known && !wheels_rest_) return false;
  const int64_t block_age = t_us - block_.end_us;
  if (block_age > static_cast<int64_t>(2.1e6 * trust_.block_s)) return false;
  const auto quiet = [&](double times) {
    return block_.gyro_wander < times * trust_.standing_gyro && block_.accel_wander < times * trust_.standing_accel;
  };
  // A still picture is the better witness: an engine that shakes the imu does not move the car.
  if (flow_ && t_us - frame_us_ < kPictureAgeUs) return *flow_ < trust_.standing_flow_px && quiet(kShaken);
  if (!quiet(1.0)) return false;
  return wheels_known || (speed && *speed < trust_.standing_speed);
}

}  // namespace roadfix::msckf
