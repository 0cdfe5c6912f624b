/// Prior of distances, from the speeds of wheels and an INS: the source of the monocular scale. MODEL.md
/// (S.7.3)-(S.7.5).
#pragma once

#include <optional>
#include <vector>

#include "geometry/se3.h"
#include "slam/config.h"
#include "slam/distance_history.h"

namespace roadfix {

struct MeasuredDistance {
  TravelledDistance travelled;
  SpeedSource source = SpeedSource::kWheels;
};

class DistancePrior {
 public:
  DistancePrior(ScaleChoice choice, const SE3& T_vehicle_camera)
      : choice_(choice), p_camera_vehicle_(T_vehicle_camera.inverse().p) {}

  /// A speed, used from the next begin_frame() on, also for past distances.
  void add(const SpeedSample& sample) { new_speeds_.push_back(sample); }
  void begin_frame();

  /// Distance of the vehicle, from the source with the smallest sigma; no value without a source.
  [[nodiscard]] std::optional<MeasuredDistance> of_vehicle(int64_t begin_us, int64_t end_us) const;
  /// Distance of the camera between two of its poses, whose turn and direction of travel are used.
  [[nodiscard]] std::optional<MeasuredDistance> of_camera(int64_t begin_us, const SE3& T_map_begin, int64_t end_us,
                                                          const SE3& T_map_end) const;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.new_speeds_, self.wheels_, self.ins_);
  }

 private:
  ScaleChoice choice_;
  Eigen::Vector3d p_camera_vehicle_;  ///< m
  std::vector<SpeedSample> new_speeds_;
  DistanceHistory wheels_, ins_;
};

}  // namespace roadfix
