/// Simulated drives on tracks through the filter with its camera and imu alone, begun near the truth: what the camera's
/// control is held against.
#pragma once

#include <functional>
#include <map>

#include "geometry/so3.h"
#include "navigation/aiding/camera/camera_control.h"
#include "simulation/random.h"
#include "support/imu_facts.h"
#include "support/track_drive.h"

namespace roadfix::test {

struct CameraRun {
  double begin_s = 6.0, end_s = 36.0;  ///< of the drive
  bool camera = true, two_eyes = false;
  double sigma_px = 0.1, walk_px = 0.15, right_sigma_px = 0.2;  ///< what the filter is told of the tracks
  double velocity_std = 0.05, tilt_std = 2e-3, yaw_std = 1e-2;
  double camera_turn_std = 0.0;  ///< rad
  double drift = 0.0;            ///< rad/m, about each camera axis: a turn that all tracks pretend
  navigation::CameraTuning tuning;
  std::function<void(TrackPicture&)> spoil = {};     ///< what happens to a picture before it comes
  std::function<void(navigation::Mean&)> tell = {};  ///< what the calibration says wrong
};

struct CameraOutcome {
  Eigen::Matrix<double, 9, 1> error = Eigen::Matrix<double, 9, 1>::Zero();  ///< (phi, nu, rho) about the end
  Eigen::Matrix<double, 9, 9> cov = Eigen::Matrix<double, 9, 9>::Zero();
  double lens_nees = 0.0;  ///< of the lens, which is exact
  double turn_nees = 0.0;  ///< of the camera's mounting angles, where they are estimated
  int updates = 0, used = 0, refused = 0;
  double misfit = 0.0;  ///< at the end
  navigation::CameraFitness fitness = navigation::CameraFitness::kOnTrial;

  [[nodiscard]] double nees(int first, int size) const {
    const Eigen::VectorXd e = error.segment(first, size);
    return e.dot(cov.block(first, first, size, size).ldlt().solve(e)) / size;
  }
};

inline navigation::Mean true_mean(const TrackDrive& d, int64_t t_us) {
  const SE3 T_vehicle_imu{d.drive.errors.q_vehicle_imu, d.drive.config.imu.position_m};
  const Odometry truth = d.drive.truth_at(t_us);
  navigation::Mean x;
  x.t_us = t_us;
  const SE3 T = truth.T_frame_vehicle * T_vehicle_imu;
  x.nav.q_level_imu = T.q;
  x.nav.position = T.p;
  x.nav.velocity = truth.T_frame_vehicle.q * (truth.velocity + truth.angular_rate.cross(T_vehicle_imu.p));
  x.T_imu_camera = T_vehicle_imu.inverse() * d.rig.T_vehicle_left;
  x.T_left_right = d.T_left_right;
  return x;
}

inline TrackPicture picture_of(const TrackFrame& frame, const CameraRun& run) {
  TrackPicture p;
  p.t_us = frame.t_us;
  for (const TrackObservation& o : frame.tracks) {
    TrackSighting s{o.id, o.left, {}, run.sigma_px, run.walk_px, run.right_sigma_px};
    if (run.two_eyes) s.right = o.right;
    p.tracks.push_back(s);
  }
  return p;
}

/// Moves the left places of tracks as if the camera had turned since each of them was first seen.
class PretendedTurn {
 public:
  PretendedTurn(const Camera& camera, double drift) : camera_(camera), drift_(drift) {}
  /// `way`: m since the last picture.
  void operator()(TrackPicture& picture, double way) {
    way_ += way;
    for (TrackSighting& s : picture.tracks) {
      const double since = way_ - first_seen_.try_emplace(s.track, way_).first->second;
      const auto seen = camera_.unproject(s.left);
      if (!seen) continue;
      const Eigen::Vector3d turned = exp_so3(Eigen::Vector3d::Constant(-since * drift_)) * seen->homogeneous();
      s.left = camera_.distort(turned.hnormalized()).value_or(s.left);
    }
  }

 private:
  const Camera& camera_;
  double drift_;
  double way_ = 0.0;
  std::map<int64_t, double> first_seen_;
};

inline navigation::NavigationConfig facts_of(const TrackDrive& d) {
  navigation::NavigationConfig c;
  tell_imu(d.drive.config, c.facts);
  return c;
}

/// Standard deviations of a start near the truth.
inline navigation::BaseVector start_std(const CameraRun& run, const navigation::VehicleFacts& facts) {
  using namespace navigation;
  BaseVector std = BaseVector::Zero();
  std.segment<3>(kAtt) = Eigen::Vector3d(run.tilt_std, run.tilt_std, run.yaw_std);
  std.segment<3>(kVel).setConstant(run.velocity_std);
  std.segment<3>(kPos).setConstant(0.1);
  std.segment<3>(kGyroBias).setConstant(facts.gyro_bias_std);
  std.segment<3>(kAccelBias).setConstant(facts.accel_bias_std);
  std.segment<3>(kGyroScale).setConstant(facts.scale_std);
  std.segment<3>(kAccelScale).setConstant(facts.scale_std);
  std.segment<3>(kCameraTurn).setConstant(run.camera_turn_std);
  std.segment<3>(kTrackDrift).setConstant(run.tuning.drift);
  if (!run.two_eyes) std.segment<3>(kLens) = Eigen::Vector3d(0.01, 0.02, 0.05);
  return std;
}

inline navigation::BaseVector start_error(const navigation::BaseVector& std, uint64_t seed) {
  RandomStream random(seed, 0xB361);
  navigation::BaseVector d = navigation::BaseVector::Zero();
  for (int i = 0; i < 9; ++i) d(i) = std(i) * random.normal();
  return d;
}

inline CameraOutcome drive_by_camera(const TrackDrive& d, const CameraRun& run, uint64_t seed) {
  using namespace navigation;
  const NavigationConfig config = facts_of(d);
  Filter filter(config, inertial::Earth(d.drive.anchor.geodetic()), true);
  CameraFacts facts;
  facts.left = d.rig.camera.intrinsics();
  if (run.two_eyes) facts.right = facts.left;
  CameraControl camera(run.tuning, facts);
  const int64_t begin_us = d.drive.imu.front().t_us + static_cast<int64_t>(1e6 * run.begin_s);
  const int64_t end_us = d.drive.imu.front().t_us + static_cast<int64_t>(1e6 * run.end_s);
  PretendedTurn pretend(d.rig.camera, run.drift);
  Eigen::Vector3d seen_from = d.drive.truth_at(begin_us).T_frame_vehicle.p;
  CameraOutcome out;
  int64_t last_us = 0;
  bool begun = false;
  const auto noise = [&](bool) { return config.facts.imu; };
  for (const DriveEvent& e : d.events) {
    const int64_t t_us = stamp_of(e);
    if (t_us > end_us) break;
    if (const auto* imu = std::get_if<ImuSample>(&e)) {
      if (begun) {
        filter.predict(*imu, seconds_between(last_us, imu->t_us), noise(true));
      } else if (imu->t_us >= begin_us) {
        const Mean truth = true_mean(d, imu->t_us);
        const BaseVector std = start_std(run, config.facts);
        Mean told = retract(truth, start_error(std, seed), truth.nav.position);
        if (run.tell) run.tell(told);
        filter.initialise(told, std);
        begun = true;
      }
      last_us = imu->t_us;
      while (begun && camera.next_us(filter.state().x).value_or(INT64_MAX) <= imu->t_us) {
        const bool standing = d.drive.truth_at(imu->t_us).velocity.norm() < 0.05;
        const auto record = camera.use(filter, standing);
        if (!record) continue;
        ++out.updates;
        out.used += camera.counts().used;
        out.refused += camera.counts().refused;
        out.misfit = camera.misfit();
      }
    } else if (const auto* frame = std::get_if<TrackFrame>(&e); frame != nullptr && begun && run.camera) {
      TrackPicture picture = picture_of(*frame, run);
      const Eigen::Vector3d place = d.truth(*frame).T_frame_vehicle.p;
      if (run.drift != 0.0) pretend(picture, (place - seen_from).norm());
      seen_from = place;
      if (run.spoil) run.spoil(picture);
      camera.add(picture);
    }
  }
  filter.flush();
  filter.state().move_reference(filter.state().x.nav.position);
  out.error = local(filter.state().x, true_mean(d, filter.state().x.t_us), filter.state().p_ref).head<9>();
  out.cov = filter.state().P().topLeftCorner<9, 9>();
  const Eigen::Vector3d lens = filter.state().x.lens;
  if (!run.two_eyes) out.lens_nees = lens.dot(filter.state().P().block<3, 3>(kLens, kLens).ldlt().solve(lens)) / 3.0;
  if (run.camera_turn_std > 0.0) {
    const Eigen::Matrix3d off = filter.state().x.T_imu_camera.R().transpose() * true_mean(d, end_us).T_imu_camera.R();
    const Eigen::Vector3d turn = log_so3(off);
    out.turn_nees = turn.dot(filter.state().P().block<3, 3>(kCameraTurn, kCameraTurn).ldlt().solve(turn)) / 3.0;
  }
  out.fitness = camera.fitness();
  return out;
}

}  // namespace roadfix::test
