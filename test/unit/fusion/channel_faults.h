/// What may be wrong with one channel of the fusion, for half a minute of a drive.
#pragma once

#include <cmath>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tunnel.h"

namespace roadfix::test {

/// A fault of one channel from 60 s to 90 s of a drive with fixes (or without, from 40 s on).
struct Fault {
  const char* name;
  FusionChannel channel;
  std::function<bool(StreamEvent&, double since_s)> apply;  ///< false: the sample is not there
  const char* words;                                        ///< that the reason has
  double largest;                                           ///< m, of POSE_FUSED while it lasts
};

inline bool gone(StreamEvent&, double) { return false; }
inline bool says_invalid(StreamEvent& e, double) {
  e.sample.odometry.validity = Validity::kInvalid;
  return true;
}
inline bool lies(StreamEvent& e, double since_s) {  // drives off to the left
  e.sample.odometry.T_frame_vehicle.p += Eigen::Vector3d(2.0 * since_s, 3.0 * since_s, 0.0);
  return true;
}
inline bool says_nan(StreamEvent& e, double) {
  e.sample.odometry.T_frame_vehicle.p.x() = std::nan("");
  return true;
}

/// Samples of `channel` repeat what the first one in the fault said.
struct Freeze {
  std::optional<Odometry> first;
  bool operator()(StreamEvent& e, double) {
    if (!first) first = e.sample.odometry;
    const int64_t t_us = e.sample.odometry.t_us;
    e.sample.odometry = *first;
    e.sample.odometry.t_us = t_us;
    return true;
  }
};

/// Samples come a second late, with the times that they are of.
struct Late {
  std::deque<Odometry> kept;
  bool operator()(StreamEvent& e, double) {
    kept.push_back(e.sample.odometry);
    if (seconds_between(kept.front().t_us, kept.back().t_us) < 1.0) return false;
    e.sample.odometry = kept.front();
    kept.pop_front();
    return true;
  }
};

inline std::vector<StreamEvent> with(std::vector<StreamEvent> events, const Tunnel& t,
                                     const std::vector<Fault>& faults) {
  std::vector<StreamEvent> kept;
  std::vector<Fault> state = faults;
  for (StreamEvent& e : events) {
    const double s = time_of(t, e);
    bool there = true;
    for (Fault& f : state)
      if (e.sample.channel == f.channel && s >= 60.0 && s < 90.0) there = there && f.apply(e, s - 60.0);
    if (there) kept.push_back(e);
  }
  return kept;
}

inline const std::vector<Fault>& faults() {
  using enum FusionChannel;
  static const std::vector<Fault> kFaults = {
      {"INS dead", kIns, gone, "POSE_INS is silent", 2.5},
      {"INS invalid", kIns, says_invalid, "POSE_INS is invalid", 2.5},
      {"INS frozen", kIns, Freeze{}, "POSE_INS", 5.0},
      {"INS late", kIns, Late{}, "POSE_INS is silent", 2.5},
      {"INS lies", kIns, lies, "POSE_INS contradicts POSE_VO and POSE_WHEEL", 8.0},
      {"INS broken", kIns, says_nan, "POSE_INS is silent", 2.5},
      {"vision dead", kVo, gone, "", 0.5},
      {"vision frozen", kVo, Freeze{}, "", 0.5},
      {"vision late", kVo, Late{}, "", 0.5},
      {"vision lies", kVo, lies, "POSE_VO contradicts", 0.5},
      {"wheels dead", kWheel, gone, "", 0.5},
      {"wheels frozen", kWheel, Freeze{}, "", 0.5},
      {"wheels late", kWheel, Late{}, "", 0.5},
      {"wheels lie", kWheel, lies, "POSE_WHEEL contradicts", 0.5},
  };
  return kFaults;
}

}  // namespace roadfix::test
