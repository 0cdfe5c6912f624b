#include "bus/types/type_conversion.h"

namespace roadfix {

namespace {

/// What 0.1 took for the noise of a track in a picture; it did not publish any.
constexpr double kTrackNoise_px = 1.0;

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
  };
  return kRules;
}

}  // namespace roadfix
