/// Kim and Kang's (2025) filters on recorded odometries of KITTI: its Table 1 and figure 8, for the odometries that are here.
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <sstream>

#include "evaluation/alignment.h"
#include "papers/trajectory_ekf.h"
#include "support/shared_data.h"

namespace roadfix {
namespace {

struct Path3d {
  std::vector<double> times;  ///< s
  std::vector<Eigen::Vector3d> estimate, reference;
};

std::vector<std::vector<double>> rows_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::vector<double>& row = rows.emplace_back();
    for (double value = 0.0; words >> value;) row.push_back(value);
  }
  return rows;
}

/// Positions of 3 x 4 matrices; a row of 13 begins with its frame's number.
Path3d load(const std::filesystem::path& folder, const std::string& drive, const std::string& odometry) {
  const auto times = rows_of(folder / (drive + "_times.txt")), truth = rows_of(folder / (drive + "_reference.txt"));
  Path3d path;
  std::size_t frame = 0;
  const auto rows = rows_of(folder / (drive + "_" + odometry + ".txt"));
  for (const std::vector<double>& row : rows) {
    const std::size_t first = row.size() - 12;
    if (first == 1) frame = static_cast<std::size_t>(row[0]);
    path.times.push_back(times.at(frame).at(0));
    path.estimate.emplace_back(row[first + 3], row[first + 7], row[first + 11]);
    path.reference.emplace_back(truth.at(frame)[3], truth.at(frame)[7], truth.at(frame)[11]);
    ++frame;
  }
  return path;
}

/// RMSE of the positions after a similarity, m; KITTI's cameras look along z, so that x and z lie in the plane.
double rmse(const Path3d& path, const std::vector<Eigen::Vector2d>& planar) {
  std::vector<PosePair> pairs(planar.size());
  for (std::size_t i = 0; i < planar.size(); ++i) {
    pairs[i].estimate.T_frame_vehicle.p << planar[i].x(), path.estimate[i].y(), planar[i].y();
    pairs[i].reference.T_frame_vehicle.p = path.reference[i];
  }
  const auto S = align(pairs, Alignment::kSim3);
  REQUIRE(S);
  double sum = 0.0;
  for (const PosePair& pair : pairs) {
    const Odometry moved = transformed(*S, pair.estimate);
    sum += (moved.T_frame_vehicle.p - pair.reference.T_frame_vehicle.p).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

struct Outcome {
  double raw = 0.0, literal = 0.0, motion = 0.0;   ///< RMSE, m
  double largest_change = 0.0;                     ///< m, literal against the odometry
  double literal_trace = 0.0, motion_trace = 0.0;  ///< m2, settled
};

/// `noise`: white noise added to the odometry's positions, m; the motion model is told of it.
Outcome run(const Path3d& path, double noise) {
  LiteralTrajectoryEkf literal({});
  MotionTrajectoryEkf motion({std::max(0.02, noise), 1.5, 0.3});
  std::vector<Eigen::Vector2d> raw, by_literal, by_motion;
  Outcome o;
  for (std::size_t i = 0; i < path.times.size(); ++i) {
    // Two incommensurate waves: white enough, and the same everywhere.
    const auto k = static_cast<double>(i);
    const Eigen::Vector2d disturbed(path.estimate[i].x() + noise * std::sqrt(2.0) * std::sin(2.4 * k),
                                    path.estimate[i].z() + noise * std::sqrt(2.0) * std::sin(1.9 * k + 1.0));
    literal.add(disturbed);
    motion.add(i > 0 ? path.times[i] - path.times[i - 1] : 0.1, disturbed);
    raw.push_back(disturbed);
    by_literal.push_back(literal.position());
    by_motion.push_back(motion.position());
    o.largest_change = std::max(o.largest_change, (literal.position() - disturbed).norm());
  }
  o.raw = rmse(path, raw);
  o.literal = rmse(path, by_literal);
  o.motion = rmse(path, by_motion);
  o.literal_trace = literal.covariance_trace();
  o.motion_trace = motion.covariance_trace();
  return o;
}

TEST_CASE("Kim and Kang on KITTI: literally nothing changes, a motion model takes noise away and leaves the drift") {
  const auto folder = test::shared_path("data/trajectories");
  if (!folder) return;
  for (const auto& [drive, odometry] : {std::pair("kitti_00", "orb_slam"), std::pair("kitti_06", "so_dso_keyframes")}) {
    const Path3d path = load(*folder, drive, odometry);
    REQUIRE(path.times.size() > 500);
    for (const double noise : {0.0, 0.5}) {
      const Outcome o = run(path, noise);
      WARN(drive << " " << odometry << ", noise " << noise << " m: RMSE " << o.raw << " m, literal " << o.literal
                 << ", motion model " << o.motion << "; covariance trace " << o.literal_trace << " and "
                 << o.motion_trace << " m2");
      CHECK(o.largest_change < 1e-6);
      CHECK(o.literal == Approx(o.raw).epsilon(1e-9));
      CHECK(o.motion_trace > 0.0);
      CHECK(o.motion_trace < 10.0);
      CHECK(o.motion < 1.01 * o.raw);
      if (noise > 0.0) {
        const double drift = run(path, 0.0).raw;
        CHECK(o.motion * o.motion - drift * drift < 0.3 * (o.raw * o.raw - drift * drift));
      }
    }
  }
}

}  // namespace
}  // namespace roadfix
