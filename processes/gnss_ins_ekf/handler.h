/// POSE_INS, INS_STATUS and AIDING_INS from IMU, GNSS, WHEELS, MAG and VO_FEATURES: translates between messages and
/// lib/navigation.
#pragma once

#include <filesystem>
#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "navigation/config.h"

namespace roadfix {

/// configs/VEHICLE/gnss_ins_ekf.yaml.
struct GnssInsProcessConfig {
  double publish_period = 0.01;  ///< s, of data time
  double status_period = 0.2;    ///< s, of data time
  navigation::NavigationTuning navigation;
};

template <class Visitor>
void visit(GnssInsProcessConfig& c, Visitor& v) {
  v.number("publish_period_s", c.publish_period, 0.0, 10.0);
  v.number("status_period_s", c.status_period, 0.0, 10.0);
  v.group("navigation", c.navigation);
}

std::unique_ptr<Stage> make_gnss_ins_ekf(const Calibration& calibration, const GnssInsProcessConfig& config);
std::unique_ptr<Stage> make_gnss_ins_ekf(const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
