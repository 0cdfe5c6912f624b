#include <cmath>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "simulation/link.h"
#include "simulation/sensors.h"

namespace roadfix {
namespace {

/// Camera axes (x right, y down, z forward) in the vehicle's, looking straight ahead.
Eigen::Quaterniond forward_camera() {
  Eigen::Matrix3d R;
  R << 0.0, 0.0, 1.0,  //
      -1.0, 0.0, 0.0,  //
      0.0, -1.0, 0.0;
  return Eigen::Quaterniond(R);
}

/// What the faults of one eye do to the picture of one time.
PictureEffects effects_at(FaultSet& faults, double t_s) {
  PictureEffects e;
  faults.for_each(t_s, [&](ActiveFault& f) {
    switch (f->kind) {
      case FaultKind::kNoise:
        e.noise_factor *= f->get("factor");
        break;
      case FaultKind::kDark:
        e.light_factor *= f->get("factor");
        break;
      case FaultKind::kWhite:
        e.glare += f->get("glare");
        break;
      case FaultKind::kOcclude:
        e.occluded_share = std::max(e.occluded_share, f->get("share"));
        break;
      case FaultKind::kCorrupt: {
        const bool hit = f.random.uniform() < f->get("probability");
        const std::uint64_t key = f.random.bits();
        if (hit) e.corruption = key | 1U;
        break;
      }
      default:  // the link's
        break;
    }
  });
  return e;
}

void simulate_eye(SimulatedDrive& drive, const char* side, std::vector<Picture>& pictures,
                  std::vector<Delivery>& deliveries) {
  FaultSet faults(drive, Sensor::kCamera, side);
  for (std::size_t i = 0; i < drive.exposures.size(); ++i) {
    const double t_s = seconds_between(drive.config.start_utime, drive.exposures[i]);
    pictures.push_back({drive.exposures[i], i, effects_at(faults, t_s)});
  }
  deliver<Picture, int>(drive, Sensor::kCamera, drive.config.camera.link, pictures, nullptr, deliveries, side);
}

}  // namespace

CameraIntrinsics intrinsics_of(const CameraConfig& config) {
  CameraIntrinsics c;
  c.width = config.width_px;
  c.height = config.height_px;
  c.fx = config.intrinsics_px[0];
  c.fy = config.intrinsics_px[1];
  c.cx = config.intrinsics_px[2];
  c.cy = config.intrinsics_px[3];
  if (config.distortion.isZero(0.0)) return c;
  c.distortion = Distortion::kRadTan;
  for (int i = 0; i < 4; ++i) c.coefficients[static_cast<std::size_t>(i)] = config.distortion[i];
  return c;
}

SE3 nominal_T_vehicle_left(const CameraConfig& config) {
  const Eigen::Quaterniond down(Eigen::AngleAxisd(config.pitch_deg * kDegree, Eigen::Vector3d::UnitY()));
  return {down * forward_camera(), config.position_m};
}

SE3 T_left_right(const CameraConfig& config) { return {Eigen::Quaterniond::Identity(), {config.baseline_m, 0.0, 0.0}}; }

CameraConfig with_size(CameraConfig config, int width_px, int height_px) {
  const double factor = static_cast<double>(width_px) / config.width_px;
  // The middle of the first pixel is at 0 0, so a picture's edge lies at -0.5.
  config.intrinsics_px[0] *= factor;
  config.intrinsics_px[1] *= factor;
  config.intrinsics_px[2] = factor * (config.intrinsics_px[2] + 0.5) - 0.5;
  config.intrinsics_px[3] = config.intrinsics_px[3] + 0.5 - 0.5 * config.height_px;  // of the centre, off the middle
  config.intrinsics_px[3] = 0.5 * height_px + factor * config.intrinsics_px[3] - 0.5;
  config.width_px = width_px;
  config.height_px = height_px;
  return config;
}

void simulate_camera(SimulatedDrive& drive) {
  const CameraConfig& c = drive.config.camera;
  RandomStream mounting = stream_of(drive, NoiseStream::kCameraMounting);
  Vector6d error;
  error.head<3>() = c.mounting_std_m * mounting.normal3();
  error.tail<3>() = c.mounting_std_deg * kDegree * mounting.normal3();
  drive.errors.T_vehicle_left = retract(nominal_T_vehicle_left(c), error);
  if (c.layout == CameraLayout::kNone) return;
  for (const std::int64_t t_us : sample_times(c.rate_hz, 0.0, drive.config.duration_s)) {
    drive.exposures.push_back(drive.config.start_utime + t_us);
  }
  simulate_eye(drive, "left", drive.pictures_left, drive.deliveries.camera_left);
  if (c.layout != CameraLayout::kStereo) return;
  simulate_eye(drive, "right", drive.pictures_right, drive.deliveries.camera_right);
}

}  // namespace roadfix
