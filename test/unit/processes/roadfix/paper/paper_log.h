/// A log with the poses of the estimators, made from the simulator's truth, and what an evaluation needs beside them.
#pragma once

#include <filesystem>
#include <roadfix/aiding_t.hpp>
#include <roadfix/config_t.hpp>

#include "bus/log/log_writer.h"
#include "config/config.h"
#include "evaluation/drive_facts.h"
#include "simulation/scenarios.h"
#include "unit/processes/imm_fusion/fusion_wire.h"

namespace roadfix::test {

struct PaperLog {
  SimulatedDrive drive;
  InsNoise ins;
  VoNoise vision, wheels;
  bool with_vision = true, with_reference = true, with_ins = true;

  /// 45 s of a city, without fixes from 15 s to 35 s.
  PaperLog() {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 45.0;
    s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
    s.mag.rate_hz = 0.0;
    drive = simulate(s, 3);
    ins.outages = {{15.0, 35.0}};
    wheels.rate_hz = 20.0;
  }

  [[nodiscard]] int64_t at_us(double t_s) const { return drive.config.start_utime + std::llround(t_s * 1e6); }

  void write(const std::filesystem::path& path) const {
    Wire wire;
    put_facts(wire);
    if (with_ins)
      for (const StreamEvent& e : ins_stream(drive, ins, 1)) wire.put(e);
    if (with_vision)
      for (const StreamEvent& e : vo_stream(drive, vision, 1)) wire.put(e);
    for (const StreamEvent& e : wheel_stream(drive, wheels, 1)) wire.put(e);
    LogWriter writer(path);
    for (const Arrival& a : wire.take()) writer.write(a.channel, a.at_us, a.bytes);
    writer.commit();
  }

 private:
  void put_facts(Wire& wire) const {
    DriveFacts facts;
    facts.name = "small city";
    facts.first_fix_us = drive.config.start_utime;
    facts.reference = {ReferenceOf::kImu, true, true, false, 0.0};
    config_t config{};
    config.process = "drive";
    config.config_yaml = config_text(facts);
    config.calibration_yaml = "body_origin: imu\n";
    wire.put("CONFIG_DRIVE", drive.config.start_utime, config);
    for (int i = 0; with_reference && i <= 450; ++i) {
      const Odometry truth = drive.truth_at(at_us(0.1 * i));
      pose_t m{};
      fill_pose(truth, m);
      m.frame = pose_t::FRAME_ENU;
      m.anchor_lat_deg = kAnchor_deg[0];
      m.anchor_lon_deg = kAnchor_deg[1];
      m.validity = pose_t::VALIDITY_VALID;
      wire.put("REFERENCE", truth.t_us, m);
    }
    for (int t_s = 0; t_s <= 45; ++t_s) {  // the outage is not among the facts: it is found from the fixes
      if (t_s > 15 && t_s < 35) continue;
      aiding_t m{};
      m.measurement_utime = at_us(t_s);
      m.source = aiding_t::SOURCE_GNSS_POSITION;
      wire.put("AIDING_INS", at_us(t_s), m);
    }
  }
};

}  // namespace roadfix::test
