#include "navigation/aiding/prior_pose/prior_pose_control.h"

#include <cmath>

#include "navigation/aiding/prior_pose/prior_pose_model.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr double kOvertaken = 1.0;  // s: of a car that drives a prior pose is out of date then

bool sane(const PriorPose& p) {
  const bool finite = std::isfinite(p.place.latitude) && std::isfinite(p.place.longitude) &&
                      std::isfinite(p.place.height) && p.cov_enu.allFinite() && std::isfinite(p.yaw);
  return finite && p.cov_enu.diagonal().minCoeff() > 0.0 && p.yaw_std > 0.0;
}

}  // namespace

void PriorPoseControl::add(const PriorPose& told, int64_t id, AidingLog& log) {
  if (!sane(told)) return log.add(record_of(AidingSource::kPriorPose, AidingStatus::kBadInput, told.t_us), id);
  told_ = Told{told, id};
}

std::optional<double> PriorPoseControl::ahead(const Mean& x) const {
  if (x.nav.velocity.norm() < vehicle::kStandingSpeed) return 0.0;
  const double s = seconds_between(x.t_us, told_->pose.t_us);
  return std::abs(s) < kOvertaken ? std::optional(s) : std::nullopt;
}

bool PriorPoseControl::use(Filter& filter, const Eigen::Vector3d& place, AidingLog& log) {
  const std::optional<double> moved = ahead(filter.state().x);
  if (!moved) return drop(log), false;
  const Told t = take();
  const auto at = [&] { return prior_place(filter.state(), place, t.pose.cov_enu, *moved); };
  const auto yaw = [&] { return prior_heading(filter.state(), t.pose.yaw, t.pose.yaw_std); };
  const AidingRecord records[] = {filter.judge(AidingSource::kPriorPose, t.pose.t_us, at(), gates_.nis[3]),
                                  filter.judge(AidingSource::kPriorPose, t.pose.t_us, yaw(), gates_.nis[1])};
  for (const AidingRecord& r : records) {
    if (r.status == AidingStatus::kAccepted) continue;
    log.add(r, t.id);
    return false;
  }
  const Gates open = Gates::open();
  log.add(filter.fuse(AidingSource::kPriorPose, t.pose.t_us, yaw(), open.nis[1]), t.id);
  log.add(filter.fuse(AidingSource::kPriorPose, t.pose.t_us, at(), open.nis[3]), t.id);
  return true;
}

void PriorPoseControl::use_place(Filter& filter, const Eigen::Vector3d& place, double ahead, AidingLog& log) {
  const Told t = take();
  const Measurement<3> at = prior_place(filter.state(), place, t.pose.cov_enu, ahead);
  log.add(filter.fuse(AidingSource::kPriorPose, t.pose.t_us, at, Gates::open().nis[3]), t.id);
}

void PriorPoseControl::try_on(HeadingHypotheses& all, const Eigen::Vector3d& place, AidingLog& log) {
  const std::optional<double> moved = ahead(all.leader().state().x);
  if (!moved) return drop(log);
  const Told t = take();
  const Gates open = Gates::open();
  const auto yaw = [&](Filter& f) {
    return f.fuse(AidingSource::kPriorPose, t.pose.t_us, prior_heading(f.state(), t.pose.yaw, t.pose.yaw_std),
                  open.nis[1]);
  };
  const auto at = [&](Filter& f) {
    return f.fuse(AidingSource::kPriorPose, t.pose.t_us, prior_place(f.state(), place, t.pose.cov_enu, *moved),
                  open.nis[3]);
  };
  log.add(all.aid(yaw), t.id);
  log.add(all.aid(at), t.id);
}

void PriorPoseControl::drop(AidingLog& log) {
  const Told t = take();
  log.add(record_of(AidingSource::kPriorPose, AidingStatus::kNotReady, t.pose.t_us), t.id);
}

}  // namespace roadfix::navigation
