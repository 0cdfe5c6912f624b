/// What a rough road does to a car's body: heave, pitch and roll about the smooth terrain, (D.1.3) to (D.1.6) of MODEL.md.
///
/// A function of place, heading and velocity alone, smooth in all of them: the same place passed at the same speed has
/// the same bump, and a car that stands stands exactly still.
#pragma once

#include <Eigen/Dense>
#include <complex>
#include <vector>

#include "simulation/random.h"

namespace roadfix {

/// The body against a smooth road; pitch and roll as geometry/euler.h.
struct BodyDisplacement {
  double heave = 0.0;  ///< m, up, of the rear axle's centre
  double pitch = 0.0;  ///< rad, nose down
  double roll = 0.0;   ///< rad, right side down
};

class RoughRoad {
 public:
  /// roughness_m3: displacement spectrum at 0.1 cycles per metre, ISO 8608; zero is an even road.
  RoughRoad(double roughness_m3, double wheelbase, double track_width, RandomStream random);

  /// place: of the rear axle's centre, enu; heading: rad, counterclockwise from east; velocity: m/s, enu.
  [[nodiscard]] BodyDisplacement at(const Eigen::Vector2d& place, double heading,
                                    const Eigen::Vector2d& velocity) const;

 private:
  struct Wave {
    Eigen::Vector2d number;          ///< rad/m
    std::complex<double> amplitude;  ///< m, with the phase at the anchor
  };
  double wheelbase_, track_width_;
  std::vector<Wave> waves_;
};

/// Motion of the body over that of the road below a wheel, at an angular frequency in rad/s, (D.1.4).
std::complex<double> body_response(double frequency);

}  // namespace roadfix
