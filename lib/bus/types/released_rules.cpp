#include "bus/types/type_conversion.h"

namespace roadfix {

namespace {

/// What 0.1 took for the noise of a track in a picture; it did not publish any.
constexpr double kTrackNoise_px = 1.0;
/// HEALTH_GOOD: 0.1 did not publish any.
constexpr double kGoodHealth = 5.0;

}  // namespace

/// One entry for each released type that today's programs do not publish any more.
const std::vector<TypeRule>& released_rules() {
  static const std::vector<TypeRule> kRules = {
      {"0.1",
       "vo_features_t",
       "vo_features2_t",
       {{"sigma_px", "", kTrackNoise_px},
        {"walk_px", "", 0.0},
        {"right", "", 0.0},  // RIGHT_NONE
        {"right_u_px", "", 0.0},
        {"right_v_px", "", 0.0},
        {"right_sigma_px", "", 0.0}}},
      {"0.1",
       "fusion_state_t",
       "fusion_state2_t",
       {{"source", "", 0.0},  // SOURCE_NONE: 0.1 did not say
        {"leader", "", 0.0},
        {"reason", "", 0.0},
        {"channel_health", "", kGoodHealth},
        {"channel_yaw_alpha", "", 1.0},
        {"channel_scale", "", 1.0},
        {"channel_scale_std", "", 0.0},
        {"channel_contradicts", "", 0.0}}},
  };
  return kRules;
}

}  // namespace roadfix
