/// PROTECTION_INS and PROTECTION_FUSED from the poses that they bound, AIDING_INS and POSE_WHEEL: translates between
/// messages and lib/integrity.
#pragma once

#include <filesystem>
#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "integrity/integrity_config.h"

namespace roadfix {

/// configs/VEHICLE/integrity.yaml.
struct IntegrityStageConfig {
  double publish_period = 0.1;  ///< s, of the poses' time
  IntegrityConfig integrity;
};

template <class Visitor>
void visit(IntegrityStageConfig& c, Visitor& v) {
  v.number("publish_period_s", c.publish_period, 0.0, 10.0);
  v.group("integrity", c.integrity);
}

std::unique_ptr<Stage> make_integrity(const Calibration& calibration, const IntegrityStageConfig& config);
std::unique_ptr<Stage> make_integrity(const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
