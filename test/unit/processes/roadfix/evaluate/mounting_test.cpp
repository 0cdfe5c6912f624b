// A filter's poses are of the vehicle's axes; references and places of a calibration are in the imu's.
#include <catch2/catch.hpp>
#include <roadfix/ins_status_t.hpp>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "support/temporary_folder.h"
#include "unit/processes/roadfix/evaluate/small_log.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

/// A filter that is right, whose imu is turned to the left by what it has learnt, more from second to second.
double learnt_rad(double t_s) { return (2.0 + 0.01 * t_s) * kDegree; }

/// `tell`: a status does; `doubt_rad`: with this standard deviation of yaw.
EvaluationReport evaluated(const TemporaryFolder& folder, const SmallLog& small, bool tell, double doubt_rad = 0.0) {
  {
    LogWriter writer(folder / "out.lcm");
    small.write_drive(writer);
    small.write_estimate(writer, "POSE_INS", [&](double t_s, pose_t& m) {
      const Odometry imu = eight(t_s);
      const Eigen::Quaterniond q_imu_vehicle = quaternion({learnt_rad(t_s), 0.0, 0.0}).conjugate();
      const Eigen::Quaterniond q = imu.T_frame_vehicle.q * q_imu_vehicle;
      const Eigen::Vector3d velocity = q_imu_vehicle.conjugate() * imu.velocity;
      m.q_wxyz[0] = q.w(), m.q_wxyz[1] = q.x(), m.q_wxyz[2] = q.y(), m.q_wxyz[3] = q.z();
      for (int i = 0; i < 3; ++i) m.velocity_mps[i] = velocity(i);
    });
    for (double t_s = 0.0; tell && t_s < small.end_s; t_s += 1.0) {
      ins_status_t status{};
      status.utime = kStart_us + std::llround(1e6 * t_s);
      status.mounting_rad[2] = learnt_rad(t_s);
      status.mounting_std_rad[0] = status.mounting_std_rad[2] = doubt_rad;
      writer.write("INS_STATUS", status.utime, encode(status));
    }
    writer.commit();
  }
  EvaluationRequest request;
  request.log = (folder / "out.lcm");
  return evaluate_log(request);
}

}  // namespace

TEST_CASE("poses of the vehicle's axes are compared in the imu's, as the filter has learnt them") {
  const TemporaryFolder folder;
  const auto yaw_deg = [&](bool tell) {
    const EvaluationReport report = evaluated(folder, SmallLog(), tell);
    return report.channels.front().axes.yaw->rms / kDegree;
  };
  CHECK(yaw_deg(true) < 1e-3);
  CHECK(yaw_deg(false) > 2.0);  // teeth: a status that does not say it
}

TEST_CASE("what a filter does not know of the mounting is part of the claim that it is held to") {
  const TemporaryFolder folder;
  constexpr double kDoubt = 1.0 * kDegree;
  const auto attitude = [&](double doubt) {
    const EvaluationReport report = evaluated(folder, SmallLog(), true, doubt);
    return report.channels.front().consistency.attitude->median_sigma;
  };
  const double sure = attitude(0.0), unsure = attitude(kDoubt);
  // Of yaw alone: the roll of the mounting is in the pose's claim already.
  CHECK(unsure * unsure - sure * sure == Approx(kDoubt * kDoubt).epsilon(0.01));
}

TEST_CASE("a simulation's mounting turns poses, whatever a filter has learnt of it") {
  const TemporaryFolder folder;
  SmallLog small;
  const auto yaw_deg = [&] { return evaluated(folder, small, true).channels.front().axes.yaw->rms / kDegree; };
  CHECK(yaw_deg() < 1e-3);
  small.facts.reference.mounting = Eigen::Vector3d(0.0, 0.0, learnt_rad(0.0) - 1.0 * kDegree);
  CHECK(yaw_deg() == Approx(2.4).margin(0.1));  // one at first, 3.5 at the end
}
