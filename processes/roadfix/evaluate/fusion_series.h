/// FUSION_STATE over time, as far as the report shows it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "evaluation/modes.h"
#include "roadfix/fusion_state2_t.hpp"

namespace roadfix {

struct FusionSeries {
  std::vector<ModeSample> modes;                       ///< one per message that has a constant-turn mode
  std::vector<int64_t> t_us;                           ///< of each message
  std::map<std::string, std::vector<double>> weights;  ///< by channel, one per message; 0 where it is not listed
};

inline void append(const fusion_state2_t& state, FusionSeries& series) {
  series.t_us.push_back(state.utime);
  for (int i = 0; i < state.num_modes; ++i) {
    const auto mode = static_cast<std::size_t>(i);
    if (state.mode_name[mode] != "constant_turn") continue;
    series.modes.push_back({state.utime, state.mode_probability[mode]});
  }
  for (int i = 0; i < state.num_channels; ++i) {
    const auto channel = static_cast<std::size_t>(i);
    std::vector<double>& weights = series.weights[state.channel_name[channel]];
    weights.resize(series.t_us.size() - 1, 0.0);
    weights.push_back(state.channel_weight[channel]);
  }
  for (auto& [channel, weights] : series.weights) weights.resize(series.t_us.size(), 0.0);
}

}  // namespace roadfix
