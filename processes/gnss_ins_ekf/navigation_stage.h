/// The stage gnss_ins_ekf on lib/navigation, beside the one on lib/gnss_ins while both are compared: `filter: navigation`
/// in gnss_ins_ekf.yaml.
#pragma once

#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "navigation/config.h"

namespace roadfix {

struct GnssInsProcessConfig;

/// What a calibration says about the sensors; what it leaves open keeps the defaults.
/// Nothing without a left camera whose lens and mounting are known.
std::optional<navigation::CameraFacts> camera_facts(const Calibration& calibration);
navigation::VehicleFacts vehicle_facts(const Calibration& calibration);

std::unique_ptr<Stage> make_navigation_stage(const Calibration& calibration, const GnssInsProcessConfig& config);

}  // namespace roadfix
