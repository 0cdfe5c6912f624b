/// What the monitor decides: may the pose be used, and if not, why.
#pragma once

#include <string>

namespace roadfix {

enum class Verdict { kOk = 0, kDegraded = 1, kDoNotUse = 2 };

/// Something that is wrong at this moment.
struct Condition {
  std::string key;  ///< stable, for programs: "channel.GNSS.silent"
  Verdict verdict = Verdict::kDegraded;
  int rank = 0;      ///< of two that are equally bad the lower is listed first: causes before their effects
  std::string text;  ///< plain words, for people
};

/// Ranks, from cause to effect.
inline constexpr int kRankHost = 0, kRankProcess = 1, kRankSensor = 2, kRankPose = 3, kRankConsistency = 4;

}  // namespace roadfix
