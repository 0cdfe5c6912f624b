/// POSE_FUSED, POSE_LOCAL, FUSION_STATE, AIDING_FUSION and VO_RESTART from POSE_INS, POSE_VO, POSE_WHEEL and what INS
/// and vision say of themselves: translates between messages and lib/fusion.
#pragma once

#include <filesystem>
#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "fusion/fusion_config.h"

namespace roadfix {

/// configs/VEHICLE/imm_fusion.yaml.
struct ImmFusionConfig {
  double publish_period = 0.01;  ///< s, of data time
  double state_period = 0.1;     ///< s, of data time
  FusionConfig fusion;
};

template <class Visitor>
void visit(ImmFusionConfig& c, Visitor& v) {
  v.number("publish_period_s", c.publish_period, 0.0, 10.0);
  v.number("state_period_s", c.state_period, 0.0, 10.0);
  v.group("fusion", c.fusion);
}

std::unique_ptr<Stage> make_imm_fusion(const Calibration& calibration, const ImmFusionConfig& config);
std::unique_ptr<Stage> make_imm_fusion(const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
