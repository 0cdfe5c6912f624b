#include "msckf/clock_search.h"

#include <algorithm>
#include <cmath>

namespace roadfix::msckf {

namespace {

constexpr double kKnown_s = kSilentClockStd;  // standard deviation, up to which the filter finds the rest by itself
constexpr double kSigmas = 3.0;               // of the calibration's, searched, and
constexpr double kBeside_s = 0.05;            // beyond: a minimum has two sides
constexpr double kStep_s = 0.01;
constexpr double kMaxPair_s = 0.5;   // between two pictures
constexpr double kRateStd = 0.01;    // rad/s, beyond twice of which a rate counts less
constexpr int kRounds = 6;           // of reweighting the gyro's bias and the camera's turn
constexpr double kLeastTurn = 1e-4;  // rad, of the camera in the imu
constexpr size_t kLeastTurns = 30;
constexpr double kLeastTurning = 0.05;  // rad/s, root mean square
constexpr int kEvery = 5;               // pictures between two searches
constexpr double kSure_s = 0.004;       // standard deviation that is told, at most
constexpr double kLeast_s = 0.003;      // and at least
constexpr double kElsewhere_s = 0.06;   // an offset this far from the best one
constexpr double kClear = 12.0;         // must cost this much more: Cauchy's logarithms, so exp(-12)

int64_t micros(double s) { return static_cast<int64_t>(std::llround(1e6 * s)); }

}  // namespace

ClockSearch::ClockSearch(const MsckfVehicle& vehicle)
    : R_imu_camera_(vehicle.T_imu_camera.R()),
      middle_(vehicle.time_offset),
      reach_(kSigmas * vehicle.time_offset_std + kBeside_s),
      sigma_(vehicle.time_offset_std),
      camera_turn_std_(vehicle.camera_turn_std),
      searching_(vehicle.time_offset_std > kKnown_s) {}

void ClockSearch::add(const ImuSample& imu) {
  if (!searching_) return;
  Angle next{imu.t_us, {}};
  if (!angles_.empty()) next.angle = angles_.back().angle + seconds_between(angles_.back().t_us, imu.t_us) * imu.gyro;
  angles_.push_back(next);
  const int64_t oldest_us = imu.t_us - micros(kMemory_s + 2.0 * reach_);
  while (angles_.front().t_us < oldest_us) angles_.pop_front();
}

Eigen::Vector3d ClockSearch::angle_at(int64_t t_us) const {
  const auto after = std::lower_bound(angles_.begin() + 1, angles_.end() - 1, t_us,
                                      [](const Angle& a, int64_t t) { return a.t_us < t; });
  const Angle &a = *(after - 1), &b = *after;
  return a.angle + (seconds_between(a.t_us, t_us) / seconds_between(a.t_us, b.t_us)) * (b.angle - a.angle);
}

ClockSearch::Fit ClockSearch::fit(double offset, size_t begin, size_t end) const {
  const int64_t offset_us = micros(offset);
  std::vector<Eigen::Vector3d> imu, cam;
  for (size_t i = begin; i < end; ++i) {
    const Turn& t = turns_[i];
    imu.emplace_back((angle_at(t.to_us + offset_us) - angle_at(t.from_us + offset_us)) /
                     seconds_between(t.from_us, t.to_us));
    cam.emplace_back(t.rate);
  }
  const auto weight = [](double square) { return 1.0 / (1.0 + square / (4.0 * kRateStd * kRateStd)); };
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  // of the camera, against how the calibration says that it sits
  const double known = std::pow(kRateStd / std::max(camera_turn_std_, kLeastTurn), 2);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Vector3d mean_imu = Eigen::Vector3d::Zero(), mean_cam = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (size_t i = 0; i < imu.size(); ++i) {
      const double w = weight((imu[i] - R * cam[i] - bias).squaredNorm());
      mean_imu += w * imu[i];
      mean_cam += w * cam[i];
      weights += w;
    }
    mean_imu /= weights;
    mean_cam /= weights;
    Eigen::Matrix3d M = known * Eigen::Matrix3d::Identity();
    for (size_t i = 0; i < imu.size(); ++i) {
      const double w = weight((imu[i] - R * cam[i] - bias).squaredNorm());
      M += w * (imu[i] - mean_imu) * (cam[i] - mean_cam).transpose();
    }
    R = wahba_rotation(M);
    bias = mean_imu - R * mean_cam;
  }
  Fit out;
  double weights = 0.0, bends = 0.0;
  for (size_t i = 0; i < imu.size(); ++i) {
    const double square = (imu[i] - R * cam[i] - bias).squaredNorm(), w = weight(square);
    out.cost += std::log1p(square / (4.0 * kRateStd * kRateStd));
    out.square += w * square;
    weights += w;
    if (i == 0 || i + 1 == imu.size()) continue;
    const double dt = seconds_between(turns_[begin + i - 1].from_us, turns_[begin + i + 1].from_us);
    bends += w * ((imu[i + 1] - imu[i - 1]) / dt).squaredNorm();
  }
  out.square /= weights;
  out.time_information = bends / (out.square / 3.0);
  return out;
}

std::optional<ClockSearch::Found> ClockSearch::search() const {
  // Those whose moments the gyro covers at every offset: costs are compared.
  const int64_t first_us = angles_.front().t_us - micros(middle_ - reach_);
  const int64_t last_us = angles_.back().t_us - micros(middle_ + reach_);
  size_t begin = 0, end = turns_.size();
  while (begin < end && turns_[begin].from_us < first_us) ++begin;
  while (end > begin && turns_[end - 1].to_us > last_us) --end;
  if (end - begin < kLeastTurns) return std::nullopt;
  double square = 0.0;
  for (size_t i = begin; i < end; ++i) square += turns_[i].rate.squaredNorm();
  if (std::sqrt(square / static_cast<double>(end - begin)) < kLeastTurning) return std::nullopt;
  const int steps = static_cast<int>(std::floor(reach_ / kStep_s));
  std::vector<Fit> fits;
  size_t best = 0;
  for (int k = -steps; k <= steps; ++k) {
    fits.push_back(fit(middle_ + k * kStep_s, begin, end));
    if (fits.back().cost < fits[best].cost) best = fits.size() - 1;
  }
  if (best == 0 || best + 1 == fits.size()) return std::nullopt;
  for (size_t k = 0; k < fits.size(); ++k) {
    const double apart = kStep_s * std::abs(static_cast<double>(k) - static_cast<double>(best));
    if (apart > kElsewhere_s && fits[k].cost < fits[best].cost + kClear) return std::nullopt;
  }
  const double low = fits[best - 1].cost, high = fits[best + 1].cost;
  const double bend = low - 2.0 * fits[best].cost + high;
  const double sigma = 1.0 / std::sqrt(fits[best].time_information);
  if (!(bend > 0.0) || !(sigma < kSure_s)) return std::nullopt;
  const double shift = 0.5 * kStep_s * (low - high) / bend;
  return Found{middle_ + kStep_s * (static_cast<double>(best) - steps) + shift, std::max(kLeast_s, sigma)};
}

std::optional<ClockSearch::Found> ClockSearch::add(const SeenFrame& frame) {
  if (!searching_) return std::nullopt;
  const bool near = last_.t_us != 0 && seconds_between(last_.t_us, frame.t_us) < kMaxPair_s;
  if (near) {
    if (const auto pair = view_pair(last_, frame))
      turns_.push_back(
          {pair->from_us, pair->to_us, R_imu_camera_ * pair->turn / seconds_between(pair->from_us, pair->to_us)});
  }
  last_ = frame;
  while (!turns_.empty() && seconds_between(turns_.front().from_us, frame.t_us) > kMemory_s) turns_.pop_front();
  if (--until_search_ > 0 || angles_.size() < 3) return std::nullopt;
  until_search_ = kEvery;
  const auto found = search();
  if (!found) return std::nullopt;
  searching_ = false;
  sigma_ = found->sigma;
  angles_.clear();
  turns_.clear();
  last_ = {};
  return found;
}

}  // namespace roadfix::msckf
