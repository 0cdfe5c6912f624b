/// One convention for all estimators: what differs by less than so many standard deviations is chance.
#pragma once

namespace roadfix {

inline constexpr double kChance = 3.0;

}  // namespace roadfix
