#include "features/track_depths.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kNearest_m = 1.5;    // along the camera's axis
constexpr double kLeastAhead = 0.2;   // of a point's depth that is left after the motion
constexpr double kStep_px = 1.5;      // between two places tried: a patch's correlation falls off within two
constexpr int kMaxSteps = 80;         // 120 px; what is farther moves too fast to be followed
constexpr double kNear_px = 1.5;      // places all this near each other need no search
constexpr double kMatch_px = 1.0;     // standard deviation of a match
constexpr double kAside_px = 3.0;     // from the line, and
constexpr double kAlongSigmas = 4.0;  // along it, of a match that is believed
constexpr double kDepthSlack = 0.03;  // of an inverse depth per picture: the motion is not known better
constexpr double kSearchSigmas = 3.0;
constexpr int kPatch_px = 11;
constexpr float kLeastAlike = 0.7F;  // correlation of the best place; half a step off the true one costs 0.2
constexpr float kLessAlike = 0.1F;   // by which the best of the other places must stay behind
constexpr int kApart = 4;            // steps: other places
constexpr size_t kPixels = size_t{kPatch_px} * kPatch_px;

/// Where a point of the last picture is seen now, by its inverse depth: h = a + inverse * b, (T.4.1).
struct Line {
  Eigen::Vector3d a, b;
  Line(const Eigen::Vector2d& ray, const CameraMotion& motion)
      : a(motion.R_now_before * Eigen::Vector3d(ray.x(), ray.y(), 1.0)),
        b(motion.p_now_before.value_or(Eigen::Vector3d::Zero())) {}
  [[nodiscard]] Eigen::Vector3d at(double inverse) const { return a + inverse * b; }
  /// Normalised coordinates by the inverse depth.
  [[nodiscard]] Eigen::Vector2d slope(double inverse) const {
    const Eigen::Vector3d h = at(inverse);
    return (b.head<2>() - h.head<2>() * (b.z() / h.z())) / h.z();
  }
  [[nodiscard]] double farthest() const {  // largest inverse depth that is looked at
    const double ahead = b.z() < 0.0 ? (1.0 - kLeastAhead) * a.z() / -b.z() : 1.0 / kNearest_m;
    return std::min(ahead, 1.0 / kNearest_m);
  }
};

/// A patch without its mean, of length one.
struct Template {
  std::array<float, kPixels> value;
  bool flat = false;
  explicit Template(const std::vector<uint8_t>& grey) {
    for (size_t row = 0, i = 0; row < kPatch_px; ++row)
      for (size_t column = 0; column < kPatch_px; ++column, ++i)
        value[i] = grey[(row + 1) * (kPatch_px + 2) + column + 1];
    float sum = 0.0F, squares = 0.0F;
    for (const float x : value) sum += x;
    for (float& x : value) {
      x -= sum / kPixels;
      squares += x * x;
    }
    flat = !(squares > 0.0F);
    for (float& x : value) x /= std::sqrt(squares);
  }
};

/// Correlation with what is seen there, the patch grown by `scale`; nothing where it leaves the picture.
std::optional<float> alike(const Template& patch, const cv::Mat& gray, const Eigen::Vector2f& centre, float scale) {
  constexpr int kHalf = kPatch_px / 2;
  const float reach = scale * kHalf + 1.0F;
  if (!(centre.x() > reach && centre.y() > reach && centre.x() < static_cast<float>(gray.cols - 1) - reach &&
        centre.y() < static_cast<float>(gray.rows - 1) - reach))
    return std::nullopt;
  float sum = 0.0F, squares = 0.0F, product = 0.0F;
  for (int row = 0, i = 0; row < kPatch_px; ++row) {
    const float v = centre.y() + scale * static_cast<float>(row - kHalf);
    const auto v0 = static_cast<int>(v);
    const float down = v - static_cast<float>(v0);
    const uint8_t* upper = gray.ptr<uint8_t>(v0);
    const uint8_t* lower = gray.ptr<uint8_t>(v0 + 1);
    for (int column = 0; column < kPatch_px; ++column, ++i) {
      const float u = centre.x() + scale * static_cast<float>(column - kHalf);
      const auto u0 = static_cast<int>(u);
      const float right = u - static_cast<float>(u0);
      const float above = static_cast<float>(upper[u0]) * (1.0F - right) + static_cast<float>(upper[u0 + 1]) * right;
      const float below = static_cast<float>(lower[u0]) * (1.0F - right) + static_cast<float>(lower[u0 + 1]) * right;
      const float x = above + down * (below - above);
      sum += x;
      squares += x * x;
      product += x * patch.value[static_cast<size_t>(i)];
    }
  }
  const float energy = squares - sum * sum / kPixels;
  return energy > 0.0F ? product / std::sqrt(energy) : 0.0F;
}

struct Place {
  Eigen::Vector2d pixel;
  float alike = -1.0F;
};

/// The place on the line that looks most like the patch; nothing where none does, or several do.
std::optional<Eigen::Vector2d> search(const Camera& lens, const Line& line, double low, double high,
                                      const std::vector<uint8_t>& grey, const Eigen::Vector2d& offset,
                                      const cv::Mat& now) {
  const Template patch(grey);
  if (patch.flat) return std::nullopt;
  std::array<Place, kMaxSteps> places;
  int count = 0, best = -1;
  double inverse = low;
  while (count < kMaxSteps) {
    const Eigen::Vector3d h = line.at(inverse);
    const auto pixel = lens.project(h);
    if (!pixel) break;
    const auto scale = static_cast<float>(1.0 / h.z());
    const auto score = alike(patch, now, (*pixel - scale * offset).cast<float>(), scale);
    if (!score) break;
    places[static_cast<size_t>(count)] = {*pixel, *score};
    if (best < 0 || *score > places[static_cast<size_t>(best)].alike) best = count;
    ++count;
    const double speed = lens.focal() * line.slope(inverse).norm();  // px by 1/m
    if (inverse >= high || !(speed > 0.0)) break;
    inverse = std::min(high, inverse + kStep_px / speed);
  }
  if (best < 0) return std::nullopt;
  const Place& found = places[static_cast<size_t>(best)];
  if (found.alike < kLeastAlike) return std::nullopt;
  for (int i = 0; i < count; ++i)
    if (std::abs(i - best) >= kApart && places[static_cast<size_t>(i)].alike > found.alike - kLessAlike)
      return std::nullopt;
  return found.pixel;
}

}  // namespace

const TrackDepths::Known* TrackDepths::find(int64_t track) const {
  const auto at = std::lower_bound(known_.begin(), known_.end(), track,
                                   [](const Known& k, int64_t wanted) { return k.track < wanted; });
  return at != known_.end() && at->track == track ? &*at : nullptr;
}

TrackDepths::Expected TrackDepths::expect(const Camera& lens, const CameraMotion& motion, const cv::Mat& now) const {
  Expected out;
  out.hints.reserve(known_.size());
  for (const Known& k : known_) {
    const Line line(k.ray, motion);
    const double most = line.farthest();
    const double wide = k.variance < 0.0 ? most : kSearchSigmas * std::sqrt(k.variance);
    const double low = std::clamp(k.variance < 0.0 ? 0.0 : k.inverse - wide, 0.0, most);
    const double high = std::clamp(k.variance < 0.0 ? most : k.inverse + wide, 0.0, most);
    const auto from = lens.project(line.at(low)), to = lens.project(line.at(high));
    if (!from) continue;
    if ((to && (*to - *from).norm() < 2.0 * kNear_px) || k.patch.empty()) {
      const auto middle =
          lens.project(line.at(std::clamp(k.variance < 0.0 ? 0.5 * (low + high) : k.inverse, 0.0, most)));
      out.hints.push_back({k.track, (middle ? *middle : *from).cast<float>()});
      continue;
    }
    const Eigen::Vector2d offset(k.pixel.x() - std::round(k.pixel.x()), k.pixel.y() - std::round(k.pixel.y()));
    const auto place = search(lens, line, low, high, k.patch, offset, now);
    if (place)
      out.hints.push_back({k.track, place->cast<float>()});
    else
      out.lost.push_back(k.track);
  }
  return out;
}

std::vector<int64_t> TrackDepths::learn(const Camera& lens, const std::optional<CameraMotion>& motion,
                                        std::span<const Feature> found) {
  std::vector<int64_t> wrong;
  std::vector<Known> next;
  next.reserve(found.size());
  for (const Feature& feature : found) {
    const Known* before = find(feature.track);
    const auto ray = lens.unproject(feature.pixel.cast<double>());
    if (before == nullptr || !ray) continue;
    Known k;
    k.track = feature.track;
    if (!motion || !motion->p_now_before) {
      next.push_back(k);
      continue;
    }
    const Line line(before->ray, *motion);
    // (T.4.2): on the line, a.xy - z a.z + inverse (b.xy - z b.z) = 0.
    const Eigen::Vector2d a = line.a.head<2>() - *ray * line.a.z(), b = line.b.head<2>() - *ray * line.b.z();
    const double px =
        lens.focal() / line.a.z();  // by which the equation's error is pixels, but for the point's approach
    const double squared = b.squaredNorm();
    const double aside = squared > 0.0 ? px * (a.x() * b.y() - a.y() * b.x()) / std::sqrt(squared) : px * a.norm();
    const double information = squared * px * px / (kMatch_px * kMatch_px);
    const double measured = squared > 0.0 ? -a.dot(b) / squared : 0.0;
    bool fits = std::abs(aside) < kAside_px;
    if (before->variance >= 0.0) {
      const double gap = measured - before->inverse;
      fits = fits && information * gap * gap < kAlongSigmas * kAlongSigmas * (1.0 + information * before->variance);
    } else {
      fits = fits && measured * std::sqrt(information) > -kAlongSigmas;
    }
    if (!fits) wrong.push_back(k.track);
    const double known = before->variance >= 0.0 ? 1.0 / std::max(before->variance, 1e-12) : kNearest_m * kNearest_m;
    const double prior = before->variance >= 0.0 ? before->inverse : 0.0;
    const double inverse = std::max(0.0, (known * prior + information * measured) / (known + information));
    const double closer = std::max(kLeastAhead, line.at(inverse).z());  // (T.4.3)
    k.inverse = inverse / closer;
    const double grown = line.a.z() / (closer * closer);  // derivative of inverse / (a_z + inverse b_z)
    k.variance = grown * grown / (known + information) + kDepthSlack * kDepthSlack * k.inverse * k.inverse;
    next.push_back(k);
  }
  if (2 * wrong.size() > next.size()) {
    wrong.clear();
    for (Known& k : next) k.variance = -1.0;
  }
  known_ = std::move(next);
  return wrong;
}

void TrackDepths::keep(const Camera& lens, std::span<const Feature> features, const cv::Mat& picture) {
  std::vector<Known> next;
  next.reserve(features.size());
  for (const Feature& feature : features) {
    Known k;
    if (const Known* before = find(feature.track)) k = *before;
    k.track = feature.track;
    k.pixel = feature.pixel.cast<double>();
    const auto ray = lens.unproject(k.pixel);
    if (!ray) continue;
    k.ray = *ray;
    const auto patch = extract_patch(picture, feature.pixel, kPatch_px);
    if (patch) k.patch = patch->grey;
    next.push_back(std::move(k));
  }
  known_ = std::move(next);
}

void TrackDepths::save(StateWriter& writer) const {
  writer.put(static_cast<uint64_t>(known_.size()));
  for (const Known& k : known_) {
    writer.put(k.track);
    writer.put(k.ray);
    writer.put(k.pixel);
    writer.put(k.inverse);
    writer.put(k.variance);
    writer.put(std::span<const uint8_t>(k.patch));
  }
}

void TrackDepths::load(StateReader& reader) {
  known_.clear();
  constexpr uint64_t kMost = 10000;
  const auto count = reader.get<uint64_t>();
  if (count > kMost) throw std::runtime_error("state: too many tracks");
  for (uint64_t i = 0; i < count; ++i) {
    Known k;
    reader.get(k.track);
    reader.get(k.ray);
    reader.get(k.pixel);
    reader.get(k.inverse);
    reader.get(k.variance);
    reader.get(k.patch);
    known_.push_back(std::move(k));
  }
}

}  // namespace roadfix
