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
// Of the length of a normal vector in the plane, over its sigma: the median, and the median's scatter times sqrt(n).
constexpr double kMedian = 1.1774;  // sqrt(2 ln 2)
constexpr double kMedianScatter = 0.8493;
constexpr double kMedianSigmas = 3.0;
constexpr double kNoiseMemory = 0.8;  // per picture

double take_median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

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
  if (frame.t_us <= frame_us_) return;  // a start in motion comes back to it
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
    flow_ = take_median(moved_);
    num_flow_ = static_cast<int>(moved_.size());
  }
  measure_noise(frame);
  const auto half_second = static_cast<int64_t>(1e6 * trust_.block_s);
  if (frame.t_us - older_.t_us < half_second / 2) flow_.reset();  // the first pictures: too short to tell a slow car
  if (frame.t_us - newer_.t_us < half_second) return;
  std::swap(older_, newer_);
  newer_.t_us = frame.t_us;
  newer_.places.clear();
  for (const SeenPoint& point : frame.points) newer_.places.push_back({point.track, point.left});
  if (older_.places.empty()) older_ = newer_;
}

void Standing::measure_noise(const SeenFrame& frame) {
  moved_.clear();
  auto last = last_.places.begin();
  auto before = before_.places.begin();
  for (const SeenPoint& point : frame.points) {
    while (last != last_.places.end() && last->track < point.track) ++last;
    while (before != before_.places.end() && before->track < point.track) ++before;
    if (last == last_.places.end() || before == before_.places.end()) break;
    if (last->track != point.track || before->track != point.track) continue;
    moved_.push_back(point.px * (point.left - 2.0 * last->left + before->left).norm());
  }
  if (moved_.size() >= kEnoughTracks) {
    const double now = take_median(moved_) / (std::sqrt(6.0) * kMedian);
    noise_ = noise_ > 0.0 ? kNoiseMemory * noise_ + (1.0 - kNoiseMemory) * now : now;
  }
  std::swap(before_, last_);
  last_.t_us = frame.t_us;
  last_.places.clear();
  for (const SeenPoint& point : frame.points) last_.places.push_back({point.track, point.left});
}

double Standing::flow_limit() const {
  const double scatter = kMedianSigmas * kMedianScatter / std::sqrt(std::max(num_flow_, 1));
  return std::hypot(trust_.standing_flow_px, std::sqrt(2.0) * noise_ * (kMedian + scatter));
}

void Standing::add_speed(int64_t t_us, double speed) {
  wheels_us_ = t_us;
  wheels_rest_ = std::abs(speed) < kWheelRest;
}

bool Standing::wheels_rest(int64_t t_us) const {
  return wheels_us_ != 0 && t_us - wheels_us_ < kWheelAgeUs && wheels_rest_;
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
  if (flow_ && t_us - frame_us_ < kPictureAgeUs) return *flow_ < flow_limit() && quiet(kShaken);
  if (!quiet(1.0)) return false;
  return wheels_known || (speed && *speed < trust_.standing_speed);
}

}  // namespace roadfix::msckf
