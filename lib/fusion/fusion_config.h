/// Tuning of the fusion; one set for all vehicles. Keys and ranges in visit().
#pragma once

#include "fusion/channel_calibration.h"
#include "fusion/imm.h"

namespace roadfix {

/// Errors of a channel's motion that are new from step to step, and of one pose.
struct ChannelNoise {
  double place = 0.01;       ///< m per sqrt(s)
  double yaw = 1e-4;         ///< rad per sqrt(s)
  double jitter = 0.005;     ///< m, of one pose, which the next does not share
  double yaw_jitter = 1e-3;  ///< rad, likewise
  double velocity = 0.05;    ///< m/s, white, where a motion is led by velocities
  double timeout = 0.3;      ///< s without a valid sample: the channel is silent
  double correlation = 5.0;  ///< s, for which a filter's velocity error lasts
  CalibrationNoise calibration;
};

template <class Visitor>
void visit(ChannelNoise& c, Visitor& v) {
  v.number("place_m_per_rts", c.place, 1e-6, 100.0);
  v.number("yaw_rad_per_rts", c.yaw, 1e-7, 1.0);
  v.number("jitter_m", c.jitter, 0.0, 10.0);
  v.number("yaw_jitter_rad", c.yaw_jitter, 0.0, 1.0);
  v.number("velocity_mps", c.velocity, 1e-4, 10.0);
  v.number("timeout_s", c.timeout, 0.01, 60.0);
  v.number("correlation_s", c.correlation, 0.0, 1e4);
  v.group("calibration", c.calibration);
}

/// Comparison of two channels' motions over a window, with hysteresis. Squared Mahalanobis distances of 3 degrees of
/// freedom: 99.9 % and 95 %.
struct AgreementConfig {
  double gate = 16.3;
  int bad_after = 4;     ///< comparisons beyond the gate in a row: they contradict
  double clear = 7.8;    ///< and below this ...
  int good_after = 4;    ///< ... that many times in a row: they agree again
  double gross = 163.0;  ///< a single comparison beyond this is enough
};

template <class Visitor>
void visit(AgreementConfig& c, Visitor& v) {
  v.number("gate", c.gate, 0.1, 1e6);
  v.integer("bad_after", c.bad_after, 1, 10000);
  v.number("clear", c.clear, 0.01, 1e6);
  v.integer("good_after", c.good_after, 1, 10000);
  v.number("gross", c.gross, 0.1, 1e9);
}

struct FusionConfig {
  MotionNoise motion;
  ModeDurations durations;
  double turn_sigma = 0.01;   ///< rad/s, of a yaw rate as it is measured
  double speed_sigma = 0.05;  ///< m/s, likewise
  ChannelNoise ins{0.002, 2e-5, 0.0, 0.0, 0.02, 0.3, 5.0, {}};
  // Stereo or wheels give vision its lengths; nothing in a picture knows time, so that its yaw has no drift.
  ChannelNoise vo{0.01, 1e-4, 0.005, 5e-4, 0.15, 0.6, 0.0, {0.01, 2e-3, 3e-3, 1e-6, 0.1, 3e-5, 1e-5, 0.0}};
  ChannelNoise wheel{0.01, 2e-4, 0.005, 1e-4, 0.05, 0.3, 0.0, {0.01, 2e-3, 1e-3, 5e-4, 0.5, 2e-5, 1e-5, 2e-6}};
  AgreementConfig agreement;
  double jump = 1.5;             ///< m by which an INS may correct itself without a fix
  double announced = 0.3;        ///< m: steps of POSE_FUSED beyond it count as resets
  double refusal_timeout = 3.0;  ///< s of fixes without a contradiction, after one, until the INS is right
  double readmission = 0.5;      ///< s that an INS must be healthy before it is followed again
  double valid_after = 0.5;      ///< s, for which a better validity must hold before it is published
  double lost_sigma = 50.0;      ///< m, horizontal: the pose is invalid
  double unled = 2.0;            ///< s without any channel's motion: the pose is invalid
  double restart_every = 5.0;    ///< s between requests to restart the vision
};

template <class Visitor>
void visit(FusionConfig& c, Visitor& v) {
  v.group("motion", c.motion);
  v.group("durations", c.durations);
  v.number("turn_sigma_radps", c.turn_sigma, 1e-5, 1.0);
  v.number("speed_sigma_mps", c.speed_sigma, 1e-4, 10.0);
  v.group("ins", c.ins);
  v.group("vo", c.vo);
  v.group("wheel", c.wheel);
  v.group("agreement", c.agreement);
  v.number("jump_m", c.jump, 0.0, 1e6);
  v.number("announced_m", c.announced, 0.0, 1e6);
  v.number("refusal_timeout_s", c.refusal_timeout, 0.0, 1e6);
  v.number("readmission_s", c.readmission, 0.0, 1e4);
  v.number("valid_after_s", c.valid_after, 0.0, 1e4);
  v.number("lost_sigma_m", c.lost_sigma, 0.01, 1e6);
  v.number("unled_s", c.unled, 0.0, 1e4);
  v.number("restart_every_s", c.restart_every, 0.0, 1e4);
}

}  // namespace roadfix
