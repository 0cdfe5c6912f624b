#include "evaluation/slow_error.h"

#include "statistics/summary.h"

namespace roadfix {

std::vector<Eigen::Vector3d> without_slow_part(const std::vector<PoseError>& errors, double window_s) {
  std::vector<Eigen::Vector3d> out;
  out.reserve(errors.size());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // of [begin, end)
  std::size_t begin = 0, end = 0;
  for (const PoseError& e : errors) {
    while (end < errors.size() && seconds_between(e.t_us, errors[end].t_us) <= 0.5 * window_s)
      sum += errors[end++].position_frame;
    while (seconds_between(errors[begin].t_us, e.t_us) > 0.5 * window_s) sum -= errors[begin++].position_frame;
    out.emplace_back(e.position_frame - sum / static_cast<double>(end - begin));
  }
  return out;
}

std::optional<SlowlessFigures> slowless_figures(const std::vector<PoseError>& errors, double window_s, int stride) {
  if (errors.empty()) return std::nullopt;
  const std::vector<Eigen::Vector3d> left = without_slow_part(errors, window_s);
  const auto step = static_cast<std::size_t>(stride);
  std::vector<double> norms, steps;
  for (std::size_t i = 0; i < left.size(); ++i) {
    norms.push_back(left[i].norm());
    if (i + step < left.size()) steps.push_back((left[i + step] - left[i]).norm());
  }
  SlowlessFigures figures{window_s, mean(norms), root_mean_square(norms), {}};
  if (!steps.empty()) figures.rpe_mean = mean(steps);
  return figures;
}

}  // namespace roadfix
