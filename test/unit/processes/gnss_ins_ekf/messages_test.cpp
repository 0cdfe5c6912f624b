// What pose_t's state says of POSE_INS: where a heading is sought, a pose in a local frame must never look like the filter's
// own, for a tracker takes speed and level from that one.
#include <catch2/catch.hpp>

#include "gnss_ins_ekf/messages.h"

using namespace roadfix;
using navigation::Phase;

namespace {

int state_of(Validity validity, bool local, Phase phase) {
  navigation::NavigationOutput output;
  output.odometry.validity = validity;
  output.local = local;
  output.phase = phase;
  pose_t pose{};
  fill_ins_pose(output, std::nullopt, pose);
  CHECK(pose.frame == (local ? pose_t::FRAME_LOCAL : pose_t::FRAME_ENU));
  return pose.state;
}

}  // namespace

TEST_CASE("a pose in a local frame while the heading is sought says that it is sought, coasting or not") {
  for (const Phase phase : {Phase::kWaiting, Phase::kHeading}) {
    CHECK(state_of(Validity::kValid, true, phase) == pose_t::STATE_ALIGNING);
    CHECK(state_of(Validity::kCoasting, true, phase) == pose_t::STATE_ALIGNING);
  }
  // A car without a receiver seeks none; in enu the bank itself has begun to speak.
  CHECK(state_of(Validity::kValid, true, Phase::kDone) == pose_t::STATE_RUNNING);
  CHECK(state_of(Validity::kCoasting, true, Phase::kDone) == pose_t::STATE_WEAK);
  CHECK(state_of(Validity::kCoasting, false, Phase::kHeading) == pose_t::STATE_WEAK);
  CHECK(state_of(Validity::kInvalid, false, Phase::kDone) == pose_t::STATE_LOST);
  CHECK(state_of(Validity::kInvalid, true, Phase::kHeading) == pose_t::STATE_ALIGNING);
  CHECK(state_of(Validity::kInvalid, true, Phase::kWaiting) == pose_t::STATE_WAITING);
}
