#include <cmath>

#include "geometry/frames.h"
#include "simulation/link.h"
#include "simulation/sensors.h"

namespace roadfix {
namespace {

constexpr double kMicrotesla = 1e-6;  // T

}  // namespace

void simulate_mag(SimulatedDrive& drive) {
  const MagConfig& c = drive.config.mag;
  if (c.rate_hz <= 0.0) return;
  RandomStream noise = stream_of(drive, NoiseStream::kMagNoise);
  RandomStream soft = stream_of(drive, NoiseStream::kSoftIron);
  SimulationErrors& errors = drive.errors;
  errors.hard_iron =
      kMicrotesla * (c.hard_iron_ut + c.hard_iron_std_ut * stream_of(drive, NoiseStream::kHardIron).normal3());
  for (int i = 0; i < 3; ++i) errors.soft_iron.col(i) += c.soft_iron_std * soft.normal3();
  const double level = c.field_ut * std::cos(c.inclination_deg * kDegree);
  const Eigen::Vector3d field_enu = kMicrotesla * Eigen::Vector3d(level * std::sin(c.declination_deg * kDegree),
                                                                  level * std::cos(c.declination_deg * kDegree),
                                                                  -c.field_ut * std::sin(c.inclination_deg * kDegree));
  FaultSet faults(drive, Sensor::kMag);
  for (const std::int64_t t_us : sample_times(c.rate_hz, 0.0, drive.config.duration_s)) {
    const Kinematics k = drive.motion->at(seconds_between(0, t_us));
    double noise_factor = 1.0;
    Eigen::Vector3d disturbance = Eigen::Vector3d::Zero();
    faults.for_each(seconds_between(0, t_us), [&](ActiveFault& f) {
      if (f->kind == FaultKind::kNoise) noise_factor *= f->get("factor");
      if (f->kind == FaultKind::kDisturb)
        disturbance += Eigen::Vector3d(f->get("x_ut"), f->get("y_ut"), f->get("z_ut"));
    });
    MagSample sample;
    sample.t_us = drive.config.start_utime + t_us;
    sample.field = errors.soft_iron * (k.T_enu_vehicle.q.conjugate() * field_enu) + errors.hard_iron +
                   kMicrotesla * (disturbance + noise_factor * c.noise_ut * noise.normal3());
    drive.mag.push_back(sample);
  }
  deliver<MagSample, int>(drive, Sensor::kMag, c.link, drive.mag, nullptr, drive.deliveries.mag);
}

}  // namespace roadfix
