#include "slam/place_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "features/keypoints.h"
#include "geometry/so3.h"
#include "slam/pose_covariance.h"
#include "slam/state_io.h"

namespace roadfix {
namespace {

constexpr int64_t kMinPlaceGap = 20;  ///< most recent places, excluded from recognition
constexpr size_t kCandidates = 4;     ///< verified geometrically
constexpr size_t kMaxPoints = 160;    ///< stored per place
constexpr double kMaxDistance = 55;   ///< bits
constexpr double kRatio = 0.85;       ///< ratio test: best over second best
constexpr int kMinMatches = 25;
constexpr int kMinInliers = 20;
constexpr double kMinInlierShare = 0.4;
constexpr int kMinScalePairs = 8;

struct Pair {
  int view = 0, place = 0;
};

/// Smallest sigmas of a constraint.
struct Floor {
  double position, turn, scale;  ///< m, rad, relative
};
constexpr Floor kStepFloor{1e-3, 1e-5, 1e-5};
constexpr Floor kLoopFloor{0.03, 0.001, 0.02};  ///< the known place's points are not exact

Matrix7d whitening(const Matrix6d& cov, double scale_variance, const Floor& floor) {
  Matrix7d all = Matrix7d::Zero();
  all.topLeftCorner<6, 6>() = cov;
  all(6, 6) = scale_variance;
  Vector7d least;
  least << Eigen::Vector3d::Constant(floor.position), Eigen::Vector3d::Constant(floor.turn), floor.scale;
  all.diagonal() += least.cwiseAbs2();
  return whitening_of(all);
}

/// Mutual nearest neighbours with ratio test.
std::vector<Pair> match(const cv::Mat& view, const cv::Mat& place) {
  std::vector<int> best_view(static_cast<size_t>(place.rows), -1);
  std::vector<double> best_distance(static_cast<size_t>(place.rows), std::numeric_limits<double>::infinity());
  std::vector<Pair> pairs;
  for (int v = 0; v < view.rows; ++v) {
    double first = std::numeric_limits<double>::infinity(), second = first;
    int nearest = -1;
    for (int p = 0; p < place.rows; ++p) {
      const double distance = descriptor_distance(view, v, place, p);
      if (distance < first) {
        second = first;
        first = distance;
        nearest = p;
      } else {
        second = std::min(second, distance);
      }
    }
    if (nearest < 0 || first > kMaxDistance || first > kRatio * second) continue;
    const auto n = static_cast<size_t>(nearest);
    if (first < best_distance[n]) {
      best_distance[n] = first;
      best_view[n] = v;
    }
  }
  for (int p = 0; p < place.rows; ++p) {
    if (best_view[static_cast<size_t>(p)] >= 0) pairs.push_back({best_view[static_cast<size_t>(p)], p});
  }
  return pairs;
}

}  // namespace

std::optional<PlaceGraph::Recognition> PlaceGraph::verify(const PlaceView& view, size_t index, bool with_scale) const {
  const Place& place = places_[index];
  const std::vector<Pair> pairs = match(view.descriptors, place.descriptors);
  if (static_cast<int>(pairs.size()) < kMinMatches) return std::nullopt;
  std::vector<PosePoint> points;
  for (const Pair& pair : pairs) {
    points.push_back({place.points[static_cast<size_t>(pair.place)].cast<double>(),
                      view.normalised[static_cast<size_t>(pair.view)]});
  }
  PoseSolverConfig config = config_.pose;
  config.min_inliers = kMinInliers;
  auto solution = search_pose(points, config);
  if (!solution || solution->num_inliers < kMinInlierShare * static_cast<double>(pairs.size())) return std::nullopt;
  Recognition found{index, std::move(*solution), 1.0};
  if (!with_scale) return found;
  std::vector<double> ratios;  // lengths in the place's map over lengths of the camera
  const SE3 T_camera_place = found.solution.T_map_camera.inverse();
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto& own = view.p_camera[static_cast<size_t>(pairs[i].view)];
    if (!found.solution.inlier[i] || !own) continue;
    ratios.push_back((T_camera_place * points[i].p_map).z() / own->z());
  }
  if (static_cast<int>(ratios.size()) < kMinScalePairs) return std::nullopt;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  found.scale = *middle;
  if (!(found.scale > 0.2 && found.scale < 5.0)) return std::nullopt;
  return found;
}

std::optional<PlaceGraph::Recognition> PlaceGraph::recognise(const PlaceView& view, int64_t newest,
                                                             bool with_scale) const {
  if (places_.empty() || view.descriptors.empty()) return std::nullopt;
  std::optional<Recognition> best;
  for (const auto& candidate : index_.look_up(view.descriptors, newest, kCandidates)) {
    auto found = verify(view, static_cast<size_t>(candidate.place - places_.front().id), with_scale);
    if (found && (!best || found->solution.num_inliers > best->solution.num_inliers)) best = std::move(found);
  }
  return best;
}

std::optional<SE3> PlaceGraph::locate(const PlaceView& view) const {
  const auto found = recognise(view, next_id_ - 1, false);  // after a loss there is no scale to compare
  if (!found) return std::nullopt;
  const Sim3 S_place_camera{found->solution.T_map_camera.q, found->solution.T_map_camera.p, 1.0};
  return (S_map_odom_.inverse() * places_[found->place].S_map_camera * S_place_camera).rigid();
}

void PlaceGraph::store_place(const PlaceView& view) {
  Place place;
  place.id = next_id_++;
  place.cov = view.cov;
  if (loop_added_) {  // on the last place
    place.cov = transported(places_.back().cov, places_.back().S_map_camera.rigid(),
                            T_odom_last_.inverse() * view.T_odom_camera) +
                rotated(view.step.pose, S_map_odom_);
  }
  T_odom_last_ = view.T_odom_camera;
  place.S_map_camera = S_map_odom_ * Sim3{view.T_odom_camera.q, view.T_odom_camera.p, 1.0};
  for (size_t i = 0; i < view.p_camera.size() && place.points.size() < kMaxPoints; ++i) {
    if (!view.p_camera[i]) continue;
    place.points.emplace_back(view.p_camera[i]->cast<float>());
    place.descriptors.push_back(view.descriptors.row(static_cast<int>(i)));
  }
  index_.add(place.id, place.descriptors);
  places_.push_back(std::move(place));
  if (static_cast<int>(places_.size()) > config_.max_places) forget_oldest();
}

void PlaceGraph::forget_oldest() {
  places_.pop_front();
  odometry_constraints_.pop_front();
  const int64_t first = places_.front().id;
  std::erase_if(loops_,
                [first](const PoseConstraint& constraint) { return constraint.a < first || constraint.b < first; });
  index_.forget_before(first);
}

void PlaceGraph::rotate(const LevellingRotation& turn) {
  const SE3 T = turn.transform();
  const Sim3 S{T.q, T.p, 1.0};
  for (Place& place : places_) {
    place.S_map_camera = S * place.S_map_camera;
    place.cov = turn.covariance(place.cov, place.S_map_camera.rigid());
  }
  T_odom_last_ = T * T_odom_last_;
  S_map_odom_ = S * S_map_odom_ * S.inverse();
}

void PlaceGraph::move(int64_t first, const SE3& T_odom_odom) {
  const Sim3 S = S_map_odom_ * Sim3{T_odom_odom.q, T_odom_odom.p, 1.0} * S_map_odom_.inverse();
  for (Place& place : places_) {
    if (place.id >= first) place.S_map_camera = S * place.S_map_camera;
  }
  if (!places_.empty() && places_.back().id >= first) T_odom_last_ = T_odom_odom * T_odom_last_;
}

bool PlaceGraph::add_view(const PlaceView& view, bool store) {
  const auto found = recognise(view, next_id_ - kMinPlaceGap, config_.with_scale);
  const int64_t known = found ? places_[found->place].id : -1;
  if (store) {
    if (!places_.empty()) add_step(view);
    store_place(view);
  }
  if (found && known >= places_.front().id) add_loop(known, *found, view, store);
  if (!store || !std::exchange(loop_added_, false)) return false;
  optimise_places();
  ++num_loops_;
  return true;
}

void PlaceGraph::add_step(const PlaceView& view) {
  const SE3 T = T_odom_last_.inverse() * view.T_odom_camera;
  const Matrix6d cov = rotated(view.step.pose, {T_odom_last_.q.conjugate(), Eigen::Vector3d::Zero(), 1.0});
  odometry_constraints_.push_back({static_cast<int>(next_id_ - 1),
                                   static_cast<int>(next_id_),
                                   {T.q, T.p, 1.0},
                                   whitening(cov, view.step.scale, kStepFloor)});
}

/// On the last place: where the view is none, with the step back to it.
void PlaceGraph::add_loop(int64_t known, const Recognition& found, const PlaceView& view, bool stored) {
  const SE3& T_known_camera = found.solution.T_map_camera;
  const SE3 T_camera_last = view.T_odom_camera.inverse() * T_odom_last_;
  const SE3 T_known_last = T_known_camera * T_camera_last;
  Matrix6d cov = found.solution.cov;
  if (!stored) {
    const Eigen::Quaterniond q_known_odom = T_known_camera.q * view.T_odom_camera.q.conjugate();
    cov = transported(cov + rotated(view.step.pose, {q_known_odom, Eigen::Vector3d::Zero(), 1.0}), T_known_camera,
                      T_camera_last);
  }
  loops_.push_back({static_cast<int>(known),
                    static_cast<int>(places_.back().id),
                    {T_known_last.q, T_known_last.p, found.scale},
                    whitening(cov, 0.0, kLoopFloor)});
  const Sim3& S_map_known = places_[static_cast<size_t>(known - places_.front().id)].S_map_camera;
  const Matrix6d& cov_known = places_[static_cast<size_t>(known - places_.front().id)].cov;
  places_.back().cov = transported(cov_known, S_map_known.rigid(), T_known_last) +
                       rotated(cov, {S_map_known.q, Eigen::Vector3d::Zero(), 1.0});
  loop_added_ = true;
}

void PlaceGraph::optimise_places() {
  std::vector<Sim3> nodes;
  for (const Place& place : places_) nodes.push_back(place.S_map_camera);
  std::vector<PoseConstraint> constraints(odometry_constraints_.begin(), odometry_constraints_.end());
  const size_t first_loop = constraints.size();
  constraints.insert(constraints.end(), loops_.begin(), loops_.end());
  const int first = static_cast<int>(places_.front().id);
  for (PoseConstraint& constraint : constraints) {
    constraint.a -= first;
    constraint.b -= first;
  }
  (void)optimise(nodes, constraints, first_loop);
  for (size_t i = 0; i < nodes.size(); ++i) places_[i].S_map_camera = nodes[i];
  S_map_odom_ = nodes.back() * Sim3{T_odom_last_.q, T_odom_last_.p, 1.0}.inverse();
}

namespace {

void put_sim3(const Sim3& S, StateWriter& writer) {
  put_pose(S.rigid(), writer);
  writer.put(S.scale);
}

void get_sim3(Sim3& S, StateReader& reader) {
  SE3 T;
  get_pose(T, reader);
  S = {T.q, T.p, reader.get<double>()};
}

void put_tie(const PoseConstraint& constraint, StateWriter& writer) {
  writer.put(constraint.a);
  writer.put(constraint.b);
  put_sim3(constraint.S_a_b, writer);
  writer.put(constraint.whitening);
}

PoseConstraint get_tie(StateReader& reader) {
  PoseConstraint constraint;
  reader.get(constraint.a);
  reader.get(constraint.b);
  get_sim3(constraint.S_a_b, reader);
  reader.get(constraint.whitening);
  return constraint;
}

}  // namespace

void PlaceGraph::save(StateWriter& writer) const {
  writer.put(next_id_);
  writer.put(num_loops_);
  writer.put(loop_added_);
  put_pose(T_odom_last_, writer);
  put_sim3(S_map_odom_, writer);
  writer.put(static_cast<int64_t>(places_.size()));
  for (const Place& place : places_) {
    writer.put(place.id);
    put_sim3(place.S_map_camera, writer);
    writer.put(place.cov);
    writer.put(static_cast<int64_t>(place.points.size()));
    for (const Eigen::Vector3f& p : place.points) writer.put(p);
    writer.put(std::span<const uint8_t>(place.descriptors.data, place.descriptors.total()));
  }
  writer.put(static_cast<int64_t>(odometry_constraints_.size()));
  for (const PoseConstraint& constraint : odometry_constraints_) put_tie(constraint, writer);
  writer.put(static_cast<int64_t>(loops_.size()));
  for (const PoseConstraint& constraint : loops_) put_tie(constraint, writer);
}

void PlaceGraph::load(StateReader& reader) {
  *this = PlaceGraph(config_);
  reader.get(next_id_);
  reader.get(num_loops_);
  reader.get(loop_added_);
  get_pose(T_odom_last_, reader);
  get_sim3(S_map_odom_, reader);
  for (auto left = reader.get<int64_t>(); left > 0; --left) {
    Place& place = places_.emplace_back();
    reader.get(place.id);
    get_sim3(place.S_map_camera, reader);
    reader.get(place.cov);
    for (auto points = reader.get<int64_t>(); points > 0; --points) reader.get(place.points.emplace_back());
    std::vector<uint8_t> bytes;
    reader.get(bytes);
    const auto rows = static_cast<int>(place.points.size());
    if (rows > 0 && bytes.size() != 32 * place.points.size()) throw std::runtime_error("state: a place is damaged");
    if (rows > 0) place.descriptors = cv::Mat(rows, 32, CV_8UC1, bytes.data()).clone();
    index_.add(place.id, place.descriptors);
  }
  for (auto left = reader.get<int64_t>(); left > 0; --left) odometry_constraints_.push_back(get_tie(reader));
  for (auto left = reader.get<int64_t>(); left > 0; --left) loops_.push_back(get_tie(reader));
}

}  // namespace roadfix
