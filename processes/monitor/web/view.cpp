#include "monitor/web/view.h"

#include <cmath>

#include "bus/types/message.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "monitor/messages.h"
#include "monitor/web/frame_json.h"

namespace roadfix {

namespace {

constexpr double kPinYawStd = 5.0 * kDegree;  ///< of the judged estimate, for another frame to be laid on it
constexpr double kPinStd = 3.0;               ///< m

SE3 yaw_only(const SE3& T) {
  SE3 level = T;
  level.q = Eigen::AngleAxisd(yaw_of(T.q), Eigen::Vector3d::UnitZ());
  return level;
}

}  // namespace

DriveView::DriveView(Board& board, Health& health, double rate_hz, bool bytes_stay, const std::string& camera)
    : board_(board),
      health_(health),
      period_us_(std::llround(1e6 / rate_hz)),
      bytes_stay_(bytes_stay),
      chosen_(!camera.empty()),
      camera_(camera),
      reference_("REFERENCE", PoseLimits{}) {}

void DriveView::message(const std::string& channel, const std::string& type, const BusMessage& message,
                        int64_t now_us) {
  if (channel == "REFERENCE") {
    PoseFacts facts = pose_facts(decode<pose_t>(message.bytes));
    health_.to_common_frame(facts);
    if (facts.anchor) reference_.add(now_us, facts);
  } else if (type == "fusion_state2_t") {
    fusion_ = decode<fusion_state2_t>(message.bytes);
  } else if (type == "vo_status_t") {
    vo_status_ = decode<vo_status_t>(message.bytes);
  } else if (type == "vo_features2_t" && board_.watched()) {
    features_ = decode<vo_features2_t>(message.bytes);
  } else if (type == "ins_status_t") {
    ins_status_ = decode<ins_status_t>(message.bytes);
  } else if (type == "gnss_t") {
    gnss_ = decode<gnss_t>(message.bytes);
  } else if (type == "image_t") {
    if (!chosen_ && (camera_.empty() || channel == "CAMERA_LEFT")) camera_ = channel;
    if (channel != camera_) return;
    picture_utime_ = read_header(message.bytes)->utime;
    if (board_.watched()) keep_picture(message);
  }
}

void DriveView::keep_picture(const BusMessage& message) {
  const std::span<const uint8_t> bytes = message.bytes;
  const auto copy = [bytes] { return std::make_shared<const std::vector<uint8_t>>(bytes.begin(), bytes.end()); };
  if (bytes_stay_) {
    board_.put_picture(picture_utime_, copy);
  } else {
    board_.put_picture(picture_utime_, copy());
  }
}

void DriveView::pin(const PoseMonitor& monitor, const std::string& judged) {
  if (!monitor.usable() || monitor.newest()->anchor) return;
  const auto absolute = health_.poses().find(judged);
  if (absolute == health_.poses().end() || !absolute->second.usable() || !absolute->second.newest()->anchor) return;
  const PoseReport report = absolute->second.report();
  if (report.position_std > kPinStd || report.yaw_std > kPinYawStd) return;
  const int64_t t_us = std::min(monitor.newest()->odometry.t_us, absolute->second.newest()->odometry.t_us) - 100'000;
  const auto local = monitor.at(t_us), enu = absolute->second.at(t_us);
  Pin& pin = pins_[monitor.name()];
  if (!local || !enu || pin.segment == local->segment) return;
  pin.segment = local->segment;
  pin.T_enu_local = yaw_only(enu->T_frame_vehicle) * yaw_only(local->T_frame_vehicle).inverse();
}

std::optional<DriveView::Placed> DriveView::placed(const PoseMonitor& monitor) const {
  if (!monitor.usable()) return std::nullopt;
  const Odometry& o = monitor.newest()->odometry;
  const Eigen::Matrix2d cov = o.cov_pose.topLeftCorner<2, 2>();
  if (monitor.newest()->anchor) return Placed{o.T_frame_vehicle, cov, false};
  const auto pin = pins_.find(monitor.name());
  if (pin == pins_.end()) return std::nullopt;
  const Eigen::Matrix2d R = pin->second.T_enu_local.R().topLeftCorner<2, 2>();
  return Placed{pin->second.T_enu_local * o.T_frame_vehicle, R * cov * R.transpose(), true};
}

/// Of a moment that both the reference and the estimate have passed.
std::optional<Eigen::Vector2d> DriveView::error(const PoseMonitor& monitor) const {
  if (!reference_.usable() || !monitor.usable()) return std::nullopt;
  const int64_t t_us = std::min(reference_.newest()->odometry.t_us, monitor.newest()->odometry.t_us) - 100'000;
  const auto truth = reference_.at(t_us), estimate = monitor.at(t_us);
  if (!truth || !estimate) return std::nullopt;
  SE3 T = estimate->T_frame_vehicle;
  if (!monitor.newest()->anchor) {
    const auto pin = pins_.find(monitor.name());
    if (pin == pins_.end()) return std::nullopt;
    T = pin->second.T_enu_local * T;
  }
  return Eigen::Vector2d((T.p - truth->T_frame_vehicle.p).head<2>().norm(), yaw_between(truth->T_frame_vehicle.q, T.q));
}

History::Row DriveView::history_row(const HealthReport& report) const {
  History::Row row{report.now_us, static_cast<int>(report.verdict), {}};
  for (const auto& [name, monitor] : health_.poses()) {
    const auto place = placed(monitor);
    if (!place || report.now_us - monitor.newest_now_us() > 1'000'000) continue;
    const auto e = error(monitor);
    row.places[name] = {place->T_enu_vehicle.p.x(), place->T_enu_vehicle.p.y(), e ? e->x() : kNothing,
                        horizontal_ellipse(place->cov).major};
  }
  if (reference_.usable()) {
    const Eigen::Vector3d& p = reference_.newest()->odometry.T_frame_vehicle.p;
    row.places["REFERENCE"] = {p.x(), p.y(), kNothing, kNothing};
  }
  return row;
}

void DriveView::decided(const HealthReport& report, bool) {
  for (const auto& [name, monitor] : health_.poses()) pin(monitor, report.judged_pose);
  board_.history().add(history_row(report));
  if (!board_.watched() || report.now_us - framed_us_ < period_us_) return;
  framed_us_ = report.now_us;
  board_.put_frame(frame(report));
}

std::string DriveView::frame(const HealthReport& report) {
  FrameParts parts(report);
  for (const auto& [name, monitor] : health_.poses()) {
    FramePose pose;
    pose.report = monitor.report();
    pose.age_s = seconds_between(monitor.newest_now_us(), report.now_us);
    pose.error = error(monitor);
    if (const auto place = placed(monitor)) {
      pose.on_map = FrameMark{place->T_enu_vehicle.p.head<2>(), yaw_of(place->T_enu_vehicle.q),
                              horizontal_ellipse(place->cov), place->pinned};
    }
    parts.poses.push_back(pose);
  }
  if (reference_.usable()) {
    const SE3& T = reference_.newest()->odometry.T_frame_vehicle;
    parts.reference = FrameMark{T.p.head<2>(), yaw_of(T.q), {}, false};
  }
  if (gnss_ && health_.anchor() && gnss_->fix_type != gnss_t::FIX_NONE) {
    const Eigen::Vector3d p =
        EnuAnchor(*health_.anchor()).enu({gnss_->lat_deg * kDegree, gnss_->lon_deg * kDegree, gnss_->height_m});
    parts.fix = p.head<2>();
  }
  parts.fusion = fusion_ ? &*fusion_ : nullptr;
  parts.vo_status = vo_status_ ? &*vo_status_ : nullptr;
  parts.features = features_ ? &*features_ : nullptr;
  parts.ins_status = ins_status_ ? &*ins_status_ : nullptr;
  parts.gnss = gnss_ ? &*gnss_ : nullptr;
  parts.picture_utime = picture_utime_;
  return frame_json(parts);
}

}  // namespace roadfix
