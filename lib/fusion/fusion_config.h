/// Tuning of the fusion; one set for all vehicles. Keys and ranges in visit().
#pragma once

#include "fusion/adaptive_covariance.h"
#include "fusion/arbitration.h"
#include "fusion/frame_tie.h"
#include "fusion/motion_model.h"
#include "fusion/return_limiter.h"

namespace roadfix {

/// kLiteral: Lee et al. (2025), each pose an independent absolute measurement. kRelative: motion since the last use, and of
/// absolute poses only what they gained (MODEL.md, section 4).
enum class FusionScheme { kRelative, kLiteral };

/// Least uncertainty of one channel's motion.
struct MotionFloor {
  double position = 0.01;  ///< m per sqrt(s)
  double share = 0.0;      ///< of the way between two uses, along it
  double across = 0.0;     ///< the same across it
  double yaw = 2e-4;       ///< rad per sqrt(s)
};

template <class Visitor>
void visit(MotionFloor& c, Visitor& v) {
  v.number("position_m_per_rts", c.position, 1e-6, 100.0);
  v.number("share", c.share, 0.0, 1.0);
  v.number("share_across", c.across, 0.0, 1.0);
  v.number("yaw_rad_per_rts", c.yaw, 1e-7, 1.0);
}

struct FusionConfig {
  FusionScheme scheme = FusionScheme::kRelative;
  MotionNoise motion;
  double straight_duration = 10.0;  ///< s, mean duration of the mode
  double turn_duration = 4.0;       ///< s
  double turn_sigma = 0.01;         ///< rad/s, of a yaw rate as it is measured
  double speed_sigma = 0.05;        ///< m/s, white error of a speed, beside what the channel says of it
  MotionFloor ins_floor{0.002, 0.0, 0.0, 2e-5};
  MotionFloor vo_floor{0.005, 0.005, 0.002, 6e-5};  ///< stereo sees the way less sharply than its direction
  MotionFloor wheel_floor{0.01, 0.003, 0.003, 5e-4};
  double vo_jitter = 0.005;     ///< m, error of one picture's place that the next ones do not have, of a vision that
                                ///< does not tell it
  double vo_yaw_jitter = 1e-3;  ///< rad, likewise
  double vo_scale_std = 0.03;   ///< before GNSS has shown it
  double vo_turns_std = 0.003;  ///< share of its turns: the focal length (slam's M.22), a gyro's scale
  double wheel_scale_std = 0.01;
  double least_gain = 0.01;       ///< share of variance that an absolute pose must take away to be used
  double gate = 16.3;             ///< squared Mahalanobis distance, 99.9 % of 3 degrees of freedom
  double refusal_timeout = 10.0;  ///< s of refused absolute poses after which they are right
  double ins_timeout = 0.3;       ///< s without a sample: the channel is dead
  double vo_timeout = 0.6;        ///< s
  double wheel_timeout = 0.3;     ///< s
  double jump_tolerance = 0.05;   ///< m between pose difference and velocity: the estimator corrected itself
  double restart_every = 5.0;     ///< s between requests to restart the vision
  AdaptiveConfig adaptive;
  AgreementConfig agreement;
  TieNoise tie;
  ReturnConfig comeback;
};

template <class Visitor>
void visit(FusionConfig& c, Visitor& v) {
  v.choice("scheme", c.scheme, {{"relative", FusionScheme::kRelative}, {"literal", FusionScheme::kLiteral}});
  v.group("motion", c.motion);
  v.number("straight_duration_s", c.straight_duration, 0.01, 1e4);
  v.number("turn_duration_s", c.turn_duration, 0.01, 1e4);
  v.number("turn_sigma_radps", c.turn_sigma, 1e-5, 1.0);
  v.number("speed_sigma_mps", c.speed_sigma, 1e-4, 10.0);
  v.group("ins_floor", c.ins_floor);
  v.group("vo_floor", c.vo_floor);
  v.group("wheel_floor", c.wheel_floor);
  v.number("vo_jitter_m", c.vo_jitter, 0.0, 10.0);
  v.number("vo_yaw_jitter_rad", c.vo_yaw_jitter, 0.0, 1.0);
  v.number("vo_scale_std", c.vo_scale_std, 0.0, 1.0);
  v.number("vo_turns_std", c.vo_turns_std, 0.0, 1.0);
  v.number("wheel_scale_std", c.wheel_scale_std, 0.0, 1.0);
  v.number("least_gain", c.least_gain, 0.001, 0.999);
  v.number("gate", c.gate, 0.1, 1e9);
  v.number("refusal_timeout_s", c.refusal_timeout, 0.0, 1e6);
  v.number("ins_timeout_s", c.ins_timeout, 0.01, 60.0);
  v.number("vo_timeout_s", c.vo_timeout, 0.01, 60.0);
  v.number("wheel_timeout_s", c.wheel_timeout, 0.01, 60.0);
  v.number("jump_tolerance_m", c.jump_tolerance, 1e-4, 100.0);
  v.number("restart_every_s", c.restart_every, 0.0, 1e4);
  v.group("adaptive", c.adaptive);
  v.group("agreement", c.agreement);
  v.group("tie", c.tie);
  v.group("return", c.comeback);
}

}  // namespace roadfix
