/// A log as a replay writes it: REFERENCE, CONFIG_DRIVE and estimates of an analytic drive.
#pragma once

#include <cmath>
#include <filesystem>

#include "bus/log/log_writer.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "evaluation/drive_facts.h"
#include "geometry/frames.h"
#include "roadfix/config_t.hpp"
#include "roadfix/pose_t.hpp"
#include "unit/evaluation/synthetic.h"

namespace roadfix::test {

inline constexpr int64_t kStart_us = 1'752'003'258'000'000;

inline pose_t pose_message(const Odometry& pose, const Geodetic& anchor) {
  pose_t m{};
  m.utime = pose.t_us + kStart_us;
  m.frame = pose_t::FRAME_ENU;
  m.anchor_lat_deg = anchor.latitude / kDegree;
  m.anchor_lon_deg = anchor.longitude / kDegree;
  m.anchor_height_m = anchor.height;
  m.origin = pose_t::ORIGIN_IMU;
  const SE3& T = pose.T_frame_vehicle;
  for (int i = 0; i < 3; ++i) {
    m.position_m[i] = T.p(i);
    m.velocity_mps[i] = pose.velocity(i);
    m.angular_rate_radps[i] = pose.angular_rate(i);
    m.cov_pose_m2_rad2[i][i] = 0.04;
    m.cov_pose_m2_rad2[i + 3][i + 3] = 1e-4;
    m.cov_velocity_m2ps2[i][i] = 0.01;
  }
  const double q[] = {T.q.w(), T.q.x(), T.q.y(), T.q.z()};
  std::copy(q, q + 4, m.q_wxyz);
  m.validity = pose_t::VALIDITY_VALID;
  return m;
}

struct SmallLog {
  Geodetic anchor{0.85, 0.15, 420.0};
  double end_s = 250.0;
  DriveFacts facts;

  SmallLog() {
    facts.name = "small <drive>";
    facts.first_fix_us = kStart_us;
    facts.reference = {ReferenceOf::kImu, true, true, false, 0.0};
    facts.score = {20.0, {FixType::kRtkFixed}};
    facts.outages = {{kStart_us + 60'000'000, kStart_us + 89'000'000, kStart_us + 90'000'000},
                     {kStart_us + 160'000'000, kStart_us + 189'000'000, kStart_us + 190'000'000}};
  }

  void write_drive(LogWriter& writer) const {
    config_t config{};
    config.utime = kStart_us;
    config.process = "drive";
    config.config_yaml = config_text(facts);
    config.calibration_yaml = "body_origin: imu\nsensors:\n  gnss: {lever_arm_body_m: [1.0, 0.5, 1.5]}\n";
    writer.write("CONFIG_DRIVE", config.utime, encode(config));
    for (int i = 0; i <= std::lround(end_s * 10); ++i) {
      const pose_t m = pose_message(eight(0.1 * i), anchor);
      writer.write("REFERENCE", m.utime, encode(m));
    }
  }

  /// An estimate with `change` applied to each pose and its message, 20 Hz.
  template <class Change>
  void write_estimate(LogWriter& writer, const std::string& channel, const Change& change) const {
    for (int i = 0; i <= std::lround(end_s * 20); ++i) {
      Odometry pose = eight(0.05 * i);
      pose_t m = pose_message(pose, anchor);
      change(0.05 * i, m);
      writer.write(channel, m.utime, encode(m));
    }
  }
};

}  // namespace roadfix::test
