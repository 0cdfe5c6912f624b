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
    r = applier_.apply(*core_, p, gates_);
  } else if (r.status == AidingStatus::kAccepted) {
    refused_wheels_.accepted();
    wheel_doubt_.wheels(excess);
    core_->mend_scale(config_.aiding.gate_sigma);
  }
}

/// A fixed carrier phase was checked against its neighbours before it was called so, and tyres do slip: where the two
/// tell another speed, the wheels' scale is asked anew, with room for what they have told wrong meanwhile, (M.45).
void GnssIns::ask_wheels(const Pending& velocity, const AidingRecord& r) {
  const NavState& x = core_->state();
  const Eigen::Vector3d along = x.q_enu_imu * x.R_imu_vehicle().col(0);
  const double speed = along.dot(x.velocity), noise = config_.vehicle.wheel_noise;
  const Eigen::Vector3d excess = Eigen::Map<const Eigen::Vector3d>(r.innovation.data());
  imu_doubt_.receiver(velocity.t_us, excess, velocity.cov, along, noise * noise, config_.aiding.gate_sigma);
  const auto doubt =
      wheel_doubt_.receiver({velocity.t_us, speed, along.dot(excess), along.dot(velocity.cov * along), noise * noise,
                             core_->last_covariance()(kWheelScale, kWheelScale), along.dot(velocity.contradiction)},
                            config_.aiding.gate_sigma);
  if (!doubt) return;
  const double wrong = doubt->share * doubt->way;  // m, in whatever direction it was driven
  const Eigen::Vector3d too_fast = doubt->share * speed * along;
  ErrorMatrix P = core_->covariance();
  P(kWheelScale, kWheelScale) += doubt->share * doubt->share;
  P.block<3, 3>(kVel, kVel) += too_fast * too_fast.transpose();
  P.diagonal().segment<2>(kPos).array() += wrong * wrong;
  core_->replace_covariance(P);
}

}  // namespace roadfix
