#include "roadfix/place/place.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <roadfix/aiding_t.hpp>
#include <roadfix/pose_t.hpp>

#include "bus/types/message.h"
#include "bus/types/schema.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

pose_t message_of(const PriorPose& told, int64_t run) {
  pose_t m{};
  m.utime = told.t_us;
  m.run = run;
  m.frame = pose_t::FRAME_ENU;
  m.anchor_lat_deg = told.place.latitude / kDegree;
  m.anchor_lon_deg = told.place.longitude / kDegree;
  m.anchor_height_m = told.place.height;
  m.origin = pose_t::ORIGIN_IMU;
  m.scale = pose_t::SCALE_METRIC;
  m.validity = pose_t::VALIDITY_VALID;
  m.reason = "told by a person";
  const Eigen::Quaterniond q = normalized_positive(exp_q({0.0, 0.0, told.yaw}));
  m.q_wxyz[0] = q.w();
  m.q_wxyz[3] = q.z();
  m.reset_delta_q_wxyz[0] = 1.0;
  for (int i = 0; i < 3; ++i) m.cov_pose_m2_rad2[i][i] = told.cov_enu(i, i);
  m.cov_pose_m2_rad2[5][5] = told.yaw_std * told.yaw_std;
  return m;
}

std::string sentence(const aiding_t& m) {
  switch (m.status) {
    case aiding_t::STATUS_ACCEPTED:
      return "used";
    case aiding_t::STATUS_GATED:
      return m.dof == 1
                 ? fmt::format("not used: the filter's heading is {:.0f} deg off, {:.1f} of the sigmas that both claim",
                               m.innovation[0] / kDegree, std::sqrt(m.nis))
                 : fmt::format("not used: the filter is {:.0f} m off, {:.1f} of the sigmas that both claim",
                               std::hypot(m.innovation[0], m.innovation[1]), std::sqrt(m.nis));
    case aiding_t::STATUS_NOT_READY:
      return "not used: the car has driven on since";
    default:
      return "refused: it is no place, or claims to be exact";
  }
}

}  // namespace

PlaceAnswer tell_place(Bus& bus, const PriorPose& told, int64_t run, std::chrono::milliseconds patience) {
  std::optional<PlaceAnswer> answer;
  const MessageCheck check = Schema::built_in().check_of("aiding_t");
  bus.subscribe("AIDING_INS", [&](const BusMessage& message) {
    if (check(message.bytes) != CheckResult::kOk) return;
    const aiding_t m = decode<aiding_t>(message.bytes);
    if (m.source != aiding_t::SOURCE_PRIOR_POSE || m.measurement_utime != told.t_us) return;
    answer = PlaceAnswer{m.status == aiding_t::STATUS_ACCEPTED, sentence(m)};
  });
  bus.publish("PRIOR_POSE", encode(message_of(told, run)));
  constexpr std::chrono::milliseconds kStep(50);
  for (std::chrono::milliseconds waited(0); !answer && waited < patience; waited += kStep)
    if (!bus.handle(kStep)) break;
  return answer.value_or(PlaceAnswer{
      false, "no answer: gnss_ins_ekf does not run on this bus, or keeps it until it has samples to start with"});
}

}  // namespace roadfix
