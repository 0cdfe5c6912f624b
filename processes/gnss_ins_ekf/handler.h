/// POSE_INS, INS_STATUS and AIDING_INS from IMU, GNSS, WHEELS and MAG: translates between messages and lib/gnss_ins.
#pragma once

#include <filesystem>
#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "gnss_ins/config.h"
#include "gnss_ins_ekf/navigation_stage.h"

namespace roadfix {

/// Which library estimates: the first round's filter, or the one navigation filter that is to replace it.
enum class InsFilter { kGnssIns, kNavigation };

/// configs/VEHICLE/gnss_ins_ekf.yaml.
struct GnssInsProcessConfig {
  double publish_period = 0.01;  ///< s, of data time
  double status_period = 0.2;    ///< s, of data time
  InsFilter filter = InsFilter::kNavigation;
  GnssInsTuning tuning;                     ///< of lib/gnss_ins
  navigation::NavigationTuning navigation;  ///< of lib/navigation
};

template <class Visitor>
void visit(GnssInsProcessConfig& c, Visitor& v) {
  v.number("publish_period_s", c.publish_period, 0.0, 10.0);
  v.number("status_period_s", c.status_period, 0.0, 10.0);
  v.choice("filter", c.filter, {{"gnss_ins", InsFilter::kGnssIns}, {"navigation", InsFilter::kNavigation}});
  v.group("tuning", c.tuning);
  v.group("navigation", c.navigation);
}

/// What a calibration says about the sensors; what it leaves open keeps the defaults.
GnssInsVehicle gnss_ins_vehicle(const Calibration& calibration);

std::unique_ptr<Stage> make_gnss_ins_ekf(const Calibration& calibration, const GnssInsProcessConfig& config);
std::unique_ptr<Stage> make_gnss_ins_ekf(const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
