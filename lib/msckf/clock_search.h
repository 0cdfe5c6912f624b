/// A camera's clock that is hardly known: how late its stamps are, from turning rates in the pictures and of the gyro,
/// found once in the first turn, (M.47). The filter's own estimate of it holds near the truth only: with 0.3 s to go, a
/// turn's rate is not what it was, and single updates end beside the truth and sure of it.
#pragma once

#include <deque>

#include "msckf/camera_imu.h"
#include "msckf/config.h"

namespace roadfix::msckf {

class ClockSearch {
 public:
  struct Found {
    double offset = 0.0, sigma = 0.0;  ///< s: imu time = stamp + this
  };

  static constexpr double kMemory_s = 20.0;  ///< of pictures and gyro: the longest turn, and road on both sides

  explicit ClockSearch(const MsckfVehicle& vehicle);

  /// Until then a picture's moment is not known.
  [[nodiscard]] bool searching() const { return searching_; }
  [[nodiscard]] double sigma() const { return sigma_; }

  void add(const ImuSample& imu);
  /// In the order of stamps. The offset, once, when it is known.
  std::optional<Found> add(const SeenFrame& frame);

  template <class Archive>
  void serialise(Archive& a);

 private:
  struct Angle {
    int64_t t_us = 0;
    Eigen::Vector3d angle = Eigen::Vector3d::Zero();  ///< rad, integral of the gyro's rate
  };
  struct Turn {
    int64_t from_us = 0, to_us = 0;
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();  ///< rad/s, by the pictures, imu axes
  };
  struct Fit {
    double cost = 0.0, square = 0.0, time_information = 0.0;
  };

  [[nodiscard]] Eigen::Vector3d angle_at(int64_t t_us) const;
  [[nodiscard]] Fit fit(double offset, size_t begin, size_t end) const;
  [[nodiscard]] std::optional<Found> search() const;

  Eigen::Matrix3d R_imu_camera_;
  double middle_, reach_;  ///< s, of the search
  double sigma_, camera_turn_std_;
  bool searching_;
  std::deque<Angle> angles_;
  std::deque<Turn> turns_;
  SeenFrame last_;
  int until_search_ = 0;  ///< pictures
};

}  // namespace roadfix::msckf
