/// One estimate: is it valid, how sure is it, does it jump, and where was it a moment ago.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "health/health_config.h"
#include "health/recent.h"
#include "health/verdict.h"
#include "samples/samples.h"

namespace roadfix {

struct PoseFacts {
  Odometry odometry;
  std::optional<Geodetic> anchor;  ///< of ENU; absent: a frame of the estimator's own
  bool metric = true;              ///< false: lengths are up to one common factor
  std::string reason;              ///< of its state, plain words
  int64_t run = 0;
  int32_t reset_counter = 0;
};

/// Protection levels that were published for an estimate, at the rarest of their risks.
struct BoundFacts {
  int64_t pose_us = 0;                              ///< of the pose that is bounded
  double risk = 0.0;                                ///< per pose: an error above its level, any axis
  Eigen::Vector3d level = Eigen::Vector3d::Zero();  ///< m, along, across, up; infinite where there is none
  bool usable = false;                              ///< the levels are within the alert limits
  std::string reason;                               ///< why not, plain words
};

/// 68 % of the horizontal error lies within one of these along its axis.
struct HorizontalEllipse {
  double major = 0.0;      ///< m, one sigma
  double minor = 0.0;      ///< m
  double direction = 0.0;  ///< rad, of the major axis, counterclockwise from the frame's x
};
/// Of the covariance of x and y; zero where it is not finite.
HorizontalEllipse horizontal_ellipse(const Eigen::Matrix2d& covariance);

struct PoseReport {
  std::string name;
  Validity validity = Validity::kInvalid;
  std::string reason;
  double position_std = 0.0;        ///< m, horizontal, along the worst direction
  double yaw_std = 0.0;             ///< rad
  double speed = 0.0;               ///< m/s, forward
  std::optional<BoundFacts> bound;  ///< of a pose a moment ago
};

class PoseMonitor {
 public:
  PoseMonitor(const std::string& name, const PoseLimits& limits) : name_(name), limits_(limits) {}

  /// `facts` in the frame that all absolute poses share (health/health.h sees to that).
  void add(int64_t now_us, const PoseFacts& facts);
  void add_bound(const BoundFacts& bound) { bound_ = bound; }
  /// Whether `facts` is of another run or behind a reset: what was before is no reference for it.
  [[nodiscard]] bool is_restart(const PoseFacts& facts) const {
    return newest_ && (newest_->run != facts.run || newest_->reset_counter != facts.reset_counter);
  }

  /// `judged`: this is the estimate that the verdict is about.
  void check(int64_t now_us, bool judged, std::vector<Condition>& out) const;

  [[nodiscard]] PoseReport report() const;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::optional<PoseFacts>& newest() const { return newest_; }
  [[nodiscard]] int64_t newest_now_us() const { return now_us_; }
  [[nodiscard]] bool usable() const;

  struct Point {
    int64_t t_us = 0;
    SE3 T_frame_vehicle;
    Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();
    int segment = 0;  ///< counts up where the estimate jumped, began again or was invalid
  };
  /// Between two points of one segment; absent outside of what is kept, the last seconds.
  [[nodiscard]] std::optional<Point> at(int64_t t_us) const;

 private:
  void detect_jump(int64_t now_us, const PoseFacts& facts);
  void store(const PoseFacts& facts);
  void check_covariance(bool judged, std::vector<Condition>& out) const;
  [[nodiscard]] Condition condition(const std::string& what, Verdict verdict, const std::string& text) const;

  std::string name_;
  PoseLimits limits_;
  std::optional<PoseFacts> newest_;
  std::optional<BoundFacts> bound_;
  int64_t now_us_ = 0;
  bool was_usable_ = false;
  std::deque<Point> track_;
  int segment_ = 0;
  Recent jumps_, resets_;
  double jump_m_ = 0.0, reset_m_ = 0.0;
};

}  // namespace roadfix
