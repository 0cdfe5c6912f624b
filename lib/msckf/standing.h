/// Does the vehicle stand? Quiet imu, still picture, still wheels: what is there must agree.
#pragma once

#include "msckf/config.h"
#include "msckf/tracks.h"
#include "samples/samples.h"

namespace roadfix::msckf {

/// Means over the last complete block of imu samples.
struct ImuBlock {
  int64_t end_us = 0;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  double gyro_wander = 1e9;  ///< rad/s, largest distance of a quarter's mean from the block's
  double accel_wander = 1e9;
};

class Standing {
 public:
  explicit Standing(const MsckfTrust& trust) : trust_(trust) {}

  void add(const ImuSample& imu, double dt);
  void add(const SeenFrame& frame);
  void add_speed(int64_t t_us, double speed);

  /// Imu quiet, picture still, wheels (if they spoke within a second) at rest. Without a picture, the imu and wheels
  /// must say it, or the filter itself, by `speed`.
  [[nodiscard]] bool stands(int64_t t_us, std::optional<double> speed) const;
  /// Wheels spoke within a second, and were at rest.
  [[nodiscard]] bool wheels_rest(int64_t t_us) const;
  [[nodiscard]] const ImuBlock& block() const { return block_; }
  /// Median motion of the tracks over the last half to whole second, px; nothing without enough of them.
  [[nodiscard]] const std::optional<double>& flow() const { return flow_; }
  /// Noise of a track's coordinate, px, from how three pictures in a row disagree; zero before the third.
  [[nodiscard]] double noise() const { return noise_; }
  /// What flow() may be of a vehicle that stands: the allowed motion, and what the noise alone can show, (M.38).
  [[nodiscard]] double flow_limit() const;

  template <class Archive>
  void serialise(Archive& a);

 private:
  static constexpr int kQuarters = 4;
  struct Place {
    int64_t track = 0;
    Eigen::Vector2d left = Eigen::Vector2d::Zero();
  };
  struct Picture {
    int64_t t_us = 0;
    std::vector<Place> places;
  };

  void measure_noise(const SeenFrame& frame);

  MsckfTrust trust_;
  Eigen::Matrix<double, 6, kQuarters> sums_ = Eigen::Matrix<double, 6, kQuarters>::Zero();
  Eigen::Vector4d times_ = Eigen::Vector4d::Zero();
  ImuBlock block_;
  Picture older_, newer_;
  Picture last_, before_;  ///< the two pictures before the newest
  std::optional<double> flow_;
  int num_flow_ = 0;  ///< tracks that flow_ is of
  double noise_ = 0.0;
  int64_t frame_us_ = 0;
  int64_t wheels_us_ = 0;
  bool wheels_rest_ = false;
  std::vector<double> moved_;  ///< scratch
};

}  // namespace roadfix::msckf
