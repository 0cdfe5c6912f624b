/// POSE_FUSED, POSE_LOCAL, FUSION_STATE, AIDING_FUSION and VO_RESTART from POSE_INS, POSE_VO, POSE_WHEEL and what INS
/// and vision say of themselves: translates between messages and lib/fusion or, for POSE_FUSED of the paper, lib/papers.
#pragma once

#include <filesystem>
#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "fusion/fusion_config.h"
#include "papers/literal_fusion.h"

namespace roadfix {

/// kLiteral: POSE_FUSED by Lee et al. (2025) as printed; POSE_LOCAL and VO_RESTART stay the default's.
enum class FusionScheme { kDefault, kLiteral };

/// configs/VEHICLE/imm_fusion.yaml.
struct ImmFusionConfig {
  FusionScheme scheme = FusionScheme::kDefault;
  double publish_period = 0.01;  ///< s, of data time
  double state_period = 0.1;     ///< s, of data time
  FusionConfig fusion;
  LiteralConfig literal;
};

template <class Visitor>
void visit(ImmFusionConfig& c, Visitor& v) {
  v.choice("scheme", c.scheme, {{"default", FusionScheme::kDefault}, {"literal", FusionScheme::kLiteral}});
  v.number("publish_period_s", c.publish_period, 0.0, 10.0);
  v.number("state_period_s", c.state_period, 0.0, 10.0);
  v.group("fusion", c.fusion);
  v.group("literal", c.literal);
}

std::unique_ptr<Stage> make_imm_fusion(const Calibration& calibration, const ImmFusionConfig& config);
std::unique_ptr<Stage> make_imm_fusion(const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
