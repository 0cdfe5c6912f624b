/// Prior of the direction of gravity: an INS's attitude, which levels the map once. MODEL.md (S.14.1).
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "slam/levelling.h"

namespace roadfix {

/// Attitude from an INS, for levelling.
struct AttitudeSample {
  int64_t t_us = 0;
  Eigen::Quaterniond q_level_vehicle = Eigen::Quaterniond::Identity();  ///< relative to axes with z up
  double sigma = 0.0;                                                   ///< rad, larger one of roll and pitch

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.q_level_vehicle.coeffs(), self.sigma);
  }
};

class GravityPrior {
 public:
  /// `max_sigma`: rad, of a sufficient attitude; zero: no attitude is.
  explicit GravityPrior(double max_sigma) : max_sigma_(max_sigma) {}

  void add(const AttitudeSample& sample) { new_samples_.push_back(sample); }
  /// The vehicle's attitude in the map at a frame.
  void record(int64_t t_us, const Eigen::Quaterniond& q_map_vehicle);
  /// The axes of the map are known from here on.
  void set_known() { known_ = true; }
  /// Rotation about `pivot` that levels the map, from the samples since the last call: of the first sufficient one at a
  /// recorded frame's time. At most one ever.
  [[nodiscard]] std::optional<LevellingRotation> take_levelling(const Eigen::Vector3d& pivot);

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.new_samples_, self.recorded_, self.known_);
  }

 private:
  struct Attitude {
    int64_t t_us = 0;
    Eigen::Quaterniond q_map_vehicle = Eigen::Quaterniond::Identity();

    template <class Self, class Archive>
    static void members(Self& self, Archive& archive) {
      archive(self.t_us, self.q_map_vehicle.coeffs());
    }
  };

  double max_sigma_;
  std::vector<AttitudeSample> new_samples_;
  std::deque<Attitude> recorded_;  ///< of the last frames, until the axes are known
  bool known_ = false;
};

}  // namespace roadfix
