// Wheel speeds: used, and doubted.
#include "gnss_ins/gnss_ins.h"

namespace roadfix {

/// Has their scale stepped? By little, as all innovations tell, (M.50); by so much that they are refused, (M.51).
void GnssIns::use_wheels(const Pending& p, AidingRecord& r) {
  if (r.dof == 0) return;
  const NavState& x = core_->state();
  const double excess = (1.0 + x.wheel_scale) * r.innovation[0];
  imu_doubt_.wheels(p.t_us, excess);
  if (r.status == AidingStatus::kGated) {
    const double speed = x.velocity.dot(x.q_enu_imu * x.R_imu_vehicle().col(0));
    const std::optional<double> share = refused_wheels_.refused(p.t_us, excess, speed);
    if (!share || !core_->scale_steps().follows()) return;
    ErrorMatrix P = core_->covariance();
    P(kWheelScale, kWheelScale) += *share * *share;
    core_->replace_covariance(P);
    core_->follow_scale_steps();
    ++wheel_scale_steps_;
    r = applier_.apply(*core_, p, gates_);
  } else if (r.status == AidingStatus::kAccepted) {
    refused_wheels_.accepted();
    if (core_->mend_scale(config_.aiding.gate_sigma)) ++wheel_scale_steps_;
  }
}

/// A fixed carrier phase was checked against its neighbours before it was called so.
void GnssIns::tell_imu_doubt(const Pending& velocity, const AidingRecord& r) {
  const NavState& x = core_->state();
  const Eigen::Vector3d along = x.q_enu_imu * x.R_imu_vehicle().col(0);
  const double noise = config_.vehicle.wheel_noise;
  imu_doubt_.receiver(velocity.t_us, Eigen::Map<const Eigen::Vector3d>(r.innovation.data()), velocity.cov, along,
                      noise * noise, config_.aiding.gate_sigma);
}

}  // namespace roadfix
