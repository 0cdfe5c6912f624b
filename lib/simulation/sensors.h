/// The sensors of the simulated vehicle, one function each. All are called by simulate(); each fills its samples and
/// its own errors of the drive, whose config, anchor and motion are set.
#pragma once

#include "simulation/random.h"
#include "simulation/simulate.h"

namespace roadfix {

/// One per noise source; a number once given is never given to another source.
enum class NoiseStream : std::uint64_t {
  kGyroNoise = 1,
  kAccelNoise = 2,
  kGyroBias = 3,
  kAccelBias = 4,
  kGyroDrift = 5,
  kAccelDrift = 6,
  kGyroScale = 7,
  kAccelScale = 8,
  kMounting = 9,
  kGnssPosition = 10,
  kGnssVelocity = 11,
  kGnssMultipath = 12,
  kGnssLeverArm = 13,
  kWheelNoise = 14,
  kWheelScale = 15,
  kYawRate = 16,
  kMagNoise = 17,
  kHardIron = 18,
  kSoftIron = 19,
  kLink = 20,
  kFault = 21,
  kGnssHeading = 22,
  kCameraMounting = 23,
  kScene = 24,
  kPicture = 25,
  kRoad = 26,
};

/// `instance` distinguishes sources of one kind, below 2^56.
inline RandomStream stream_of(const SimulatedDrive& drive, NoiseStream stream, std::uint64_t instance = 0) {
  return {drive.seed, static_cast<std::uint64_t>(stream) + (instance << 8U)};
}

/// A fault with random numbers of its own: they depend on the seed, its kind and its start alone.
struct ActiveFault {
  const Fault* fault;
  RandomStream random;
  const Fault* operator->() const { return fault; }
};

/// The faults of one sensor, in the order of the configuration; of one part of it where a switch of that name turns
/// them off.
class FaultSet {
 public:
  FaultSet(const SimulatedDrive& drive, Sensor sensor, const char* part = nullptr) {
    for (const Fault& f : drive.config.faults) {
      if (f.sensor != sensor || (part != nullptr && f.get(part) < 0.5)) continue;
      const auto start_ms = static_cast<std::uint64_t>(f.start_s * 1e3);
      const auto kind = static_cast<std::uint64_t>(f.kind) * 8U + static_cast<std::uint64_t>(sensor);
      faults_.push_back({&f, stream_of(drive, NoiseStream::kFault, kind + (start_ms << 16U))});
    }
  }

  /// Calls f(ActiveFault&) for those that are active t_s after the start of the drive.
  template <class Function>
  void for_each(double t_s, const Function& f) {
    for (ActiveFault& fault : faults_) {
      if (fault->active(t_s)) f(fault);
    }
  }

 private:
  std::vector<ActiveFault> faults_;
};

void simulate_imu(SimulatedDrive& drive);
void simulate_gnss(SimulatedDrive& drive);
void simulate_wheels(SimulatedDrive& drive);
void simulate_mag(SimulatedDrive& drive);
void simulate_camera(SimulatedDrive& drive);

/// Angular rate and specific force that a perfect imu measures at one instant, imu axes.
struct InertialState {
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();    ///< rad/s, against inertial space
  Eigen::Vector3d specific_force = Eigen::Vector3d::Zero();  ///< m/s2
};

struct ImuMount {
  Eigen::Quaterniond q_vehicle_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p_vehicle_imu = Eigen::Vector3d::Zero();
};

/// gravity_enu and earth_rate_enu: geodesy/gravity.h at the vehicle.
InertialState inertial_state(const Kinematics& k, const ImuMount& mount, const Eigen::Vector3d& gravity_enu,
                             const Eigen::Vector3d& earth_rate_enu);

/// Times of a sensor, microseconds after the start: round(phase + i / rate) up to the end of the drive.
std::vector<std::int64_t> sample_times(double rate_hz, double phase_s, double duration_s);

}  // namespace roadfix
