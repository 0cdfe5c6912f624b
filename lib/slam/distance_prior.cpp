#include "slam/distance_prior.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {
namespace {

/// Distance of the camera for a vehicle that goes `travelled` along an arc while the camera moves by T_begin_end, of
/// which the direction of p is used: lambda t + w = chord, with w the displacement of the vehicle's origin by the
/// rotation alone.
std::optional<double> camera_path(double travelled, const SE3& T_begin_end, const Eigen::Vector3d& p_camera_vehicle) {
  const double half_turn = 0.5 * log_q(T_begin_end.q).norm();
  const double chord = half_turn > 1e-6 ? travelled * std::sin(half_turn) / half_turn : travelled;
  const double length = T_begin_end.p.norm();
  if (!(length > 1e-6)) return std::nullopt;
  const Eigen::Vector3d t = T_begin_end.p / length;
  const Eigen::Vector3d w = T_begin_end.q * p_camera_vehicle - p_camera_vehicle;
  const double tw = t.dot(w), square = tw * tw - w.squaredNorm() + chord * chord;
  if (square < 0.0) return std::nullopt;
  const double lambda = std::sqrt(square) - tw;
  return lambda > 0.0 ? std::optional(lambda) : std::nullopt;
}

}  // namespace

void DistancePrior::begin_frame() {
  for (const SpeedSample& s : new_speeds_) (s.source == SpeedSource::kIns ? ins_ : wheels_).add(s);
  new_speeds_.clear();
}

std::optional<MeasuredDistance> DistancePrior::of_vehicle(int64_t begin_us, int64_t end_us) const {
  std::optional<MeasuredDistance> best;
  double best_sigma = 0.0;
  const auto consider = [&](const std::optional<TravelledDistance>& travelled, SpeedSource source) {
    if (!travelled) return;
    const double sigma = std::hypot(travelled->sigma, travelled->scale_std * travelled->distance);
    if (best && sigma >= best_sigma) return;
    best = MeasuredDistance{*travelled, source};
    best_sigma = sigma;
  };
  const bool wheels = choice_ == ScaleChoice::kAuto || choice_ == ScaleChoice::kWheels;
  const bool ins = choice_ == ScaleChoice::kAuto || choice_ == ScaleChoice::kIns;
  if (wheels) consider(wheels_.between(begin_us, end_us), SpeedSource::kWheels);
  if (ins) consider(ins_.between(begin_us, end_us), SpeedSource::kIns);
  if (wheels && ins) consider(rescaled_distance(ins_, wheels_, begin_us, end_us), SpeedSource::kIns);
  return best;
}

std::optional<MeasuredDistance> DistancePrior::of_camera(int64_t begin_us, const SE3& T_map_begin, int64_t end_us,
                                                         const SE3& T_map_end) const {
  auto known = of_vehicle(begin_us, end_us);
  if (!known) return known;
  const auto travelled = camera_path(known->travelled.distance, T_map_begin.inverse() * T_map_end, p_camera_vehicle_);
  if (!travelled) return std::nullopt;
  known->travelled.distance = *travelled;
  return known;
}

}  // namespace roadfix
