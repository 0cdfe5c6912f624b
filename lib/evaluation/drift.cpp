#include "evaluation/drift.h"

#include <algorithm>
#include <map>

#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr int kFirstSegment_m = 100;
constexpr int kLastSegment_m = 800;

std::vector<double> norms(const std::vector<PoseError>& errors) {
  std::vector<double> values;
  values.reserve(errors.size());
  for (const PoseError& e : errors) values.push_back(e.norm());
  return values;
}

/// Motion of the estimate from i to j, seen against the reference's, (E.4.3).
SE3 relative_error(const PosePair& i, const PosePair& j) {
  const SE3 reference = i.reference.T_frame_vehicle.inverse() * j.reference.T_frame_vehicle;
  const SE3 estimate = i.estimate.T_frame_vehicle.inverse() * j.estimate.T_frame_vehicle;
  return reference.inverse() * estimate;
}

}  // namespace

double ate_rmse(const std::vector<PoseError>& errors) { return root_mean_square(norms(errors)); }

double ate_mean(const std::vector<PoseError>& errors) { return mean(norms(errors)); }

std::optional<double> rpe_mean(const std::vector<PosePair>& pairs, int stride) {
  const auto step = static_cast<std::size_t>(stride);
  if (pairs.size() <= step) return std::nullopt;
  std::vector<double> values;
  for (std::size_t i = 0; i + step < pairs.size(); ++i) {
    const PosePair& a = pairs[i];
    const PosePair& b = pairs[i + step];
    const Eigen::Vector3d estimate = b.estimate.T_frame_vehicle.p - a.estimate.T_frame_vehicle.p;
    const Eigen::Vector3d reference = b.reference.T_frame_vehicle.p - a.reference.T_frame_vehicle.p;
    values.push_back((estimate - reference).norm());
  }
  return mean(values);
}

std::optional<RelativeError> rpe_rmse(const std::vector<PosePair>& pairs, int delta) {
  const auto step = static_cast<std::size_t>(delta);
  if (delta < 1 || pairs.size() <= step) return std::nullopt;
  std::vector<double> translation;
  std::vector<double> rotation;
  for (std::size_t i = 0; i + step < pairs.size(); i += step) {
    const SE3 error = relative_error(pairs[i], pairs[i + step]);
    translation.push_back(error.p.norm());
    rotation.push_back(log_q(error.q).norm());
  }
  return RelativeError{delta, root_mean_square(translation), root_mean_square(rotation)};
}

std::optional<KittiDrift> kitti_drift(const std::vector<PosePair>& pairs, int start_step) {
  const std::vector<double> path = path_lengths(pairs);
  std::vector<double> translation;
  std::vector<double> rotation;
  std::map<int, std::vector<double>> per_length;
  for (std::size_t first = 0; first < pairs.size(); first += static_cast<std::size_t>(start_step)) {
    for (int length = kFirstSegment_m; length <= kLastSegment_m; length += 100) {
      const auto end =
          std::upper_bound(path.begin() + static_cast<std::ptrdiff_t>(first), path.end(), path[first] + length);
      if (end == path.end()) break;
      const SE3 error = relative_error(pairs[first], pairs[static_cast<std::size_t>(end - path.begin())]);
      translation.push_back(error.p.norm() / length);
      rotation.push_back(log_q(error.q).norm() / length);
      per_length[length].push_back(100.0 * translation.back());
    }
  }
  if (translation.empty()) return std::nullopt;
  KittiDrift drift;
  drift.translation_percent = 100.0 * mean(translation);
  drift.rotation_deg_per_100m = 100.0 * mean(rotation) / kDegree;
  drift.segments = static_cast<int>(translation.size());
  for (const auto& [length, values] : per_length) drift.per_length.emplace_back(length, mean(values));
  return drift;
}

}  // namespace roadfix
