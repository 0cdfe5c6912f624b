#include "roadfix/export/foxglove_views.h"

#include <fmt/format.h>

#include <algorithm>

#include "geodesy/enu_change.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/export/foxglove_schemas.h"

namespace roadfix {
namespace {

namespace fg = foxglove;

SE3 pose_of(const pose_t& pose) {
  const double* q = pose.q_wxyz;
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(pose.position_m)};
}

ProtobufMessage location(int64_t utime, const std::string& frame, const Geodetic& place, const Eigen::Matrix3d& cov) {
  ProtobufMessage fix;
  fix.number(fg::LocationFix::kLatitude, place.latitude / kDegree);
  fix.number(fg::LocationFix::kLongitude, place.longitude / kDegree);
  fix.number(fg::LocationFix::kAltitude, place.height);
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = cov;
  fix.numbers(fg::LocationFix::kPositionCovariance, {rows.data(), 9});
  fix.varint(fg::LocationFix::kPositionCovarianceType, fg::LocationFix::kKnown);
  fix.message(fg::LocationFix::kTimestamp, fg::timestamp(utime));
  fix.text(fg::LocationFix::kFrameId, frame);
  return fix;
}

ProtobufMessage log_line(int64_t utime, uint64_t level, const std::string& name, const std::string& text) {
  ProtobufMessage log;
  log.message(fg::Log::kTimestamp, fg::timestamp(utime));
  log.varint(fg::Log::kLevel, level);
  log.text(fg::Log::kMessage, text);
  log.text(fg::Log::kName, name);
  return log;
}

template <std::size_t N>
const char* name_of(const char* const (&names)[N], int8_t code) {
  return code >= 0 && static_cast<std::size_t>(code) < N ? names[code] : "unknown";
}

}  // namespace

FoxgloveViews FoxgloveViewer::views(const std::string& channel, const pose_t& pose) {
  if (pose.validity == pose_t::VALIDITY_INVALID) return {};
  FoxgloveViews views;
  SE3 T_frame_vehicle = pose_of(pose);
  std::string frame = "local/" + channel;
  const std::string child = channel == vehicle_channel_ ? "vehicle" : channel;
  if (pose.frame == pose_t::FRAME_ENU) {
    frame = "enu";
    const Geodetic own{pose.anchor_lat_deg * kDegree, pose.anchor_lon_deg * kDegree, pose.anchor_height_m};
    const EnuAnchor anchor(own);
    const Geodetic place = anchor.geodetic(T_frame_vehicle.p);
    const Eigen::Matrix3d R = anchor.R_anchor_enu_at(place);
    Eigen::Matrix3d cov;
    for (int i = 0; i < 3; ++i) cov.row(i) = Eigen::RowVector3d(pose.cov_pose_m2_rad2[i]);
    views.push_back({"LocationFix", "location", location(pose.utime, child, place, R.transpose() * cov * R)});
    if (!anchor_) anchor_ = own;
    if (!same_anchor(*anchor_, own)) T_frame_vehicle = T_enu_enu(*anchor_, own) * T_frame_vehicle;
  }
  const Eigen::Vector3d& p = T_frame_vehicle.p;
  const Eigen::Quaterniond& q = T_frame_vehicle.q;
  ProtobufMessage place;
  place.vector(fg::Pose::kPosition, {p.x(), p.y(), p.z()});
  place.vector(fg::Pose::kOrientation, {q.x(), q.y(), q.z(), q.w()});
  ProtobufMessage in_frame;
  in_frame.message(fg::PoseInFrame::kTimestamp, fg::timestamp(pose.utime));
  in_frame.text(fg::PoseInFrame::kFrameId, frame);
  in_frame.message(fg::PoseInFrame::kPose, place);
  views.push_back({"PoseInFrame", "pose", std::move(in_frame)});
  ProtobufMessage transform;
  transform.message(fg::FrameTransform::kTimestamp, fg::timestamp(pose.utime));
  transform.text(fg::FrameTransform::kParentFrameId, frame);
  transform.text(fg::FrameTransform::kChildFrameId, child);
  transform.vector(fg::FrameTransform::kTranslation, {p.x(), p.y(), p.z()});
  transform.vector(fg::FrameTransform::kRotation, {q.x(), q.y(), q.z(), q.w()});
  views.push_back({"FrameTransform", "/tf", std::move(transform)});
  return views;
}

FoxgloveViews FoxgloveViewer::views(const std::string& /*channel*/, const gnss_t& fix) const {
  if (fix.fix_type == gnss_t::FIX_NONE) return {};
  Eigen::Matrix3d cov;
  for (int i = 0; i < 3; ++i) cov.row(i) = Eigen::RowVector3d(fix.cov_enu_m2[i]);
  const Geodetic place{fix.lat_deg * kDegree, fix.lon_deg * kDegree, fix.height_m};
  return {{"LocationFix", "location", location(fix.utime, "antenna", place, cov)}};
}

FoxgloveViews FoxgloveViewer::views(const std::string& channel, const image_t& image) const {
  ProtobufMessage picture;
  const std::span<const uint8_t> data(image.data);
  if (image.format == image_t::FORMAT_JPEG || image.format == image_t::FORMAT_PNG) {
    picture.message(fg::CompressedImage::kTimestamp, fg::timestamp(image.utime));
    picture.bytes(fg::CompressedImage::kData, data);
    picture.text(fg::CompressedImage::kFormat, image.format == image_t::FORMAT_PNG ? "png" : "jpeg");
    picture.text(fg::CompressedImage::kFrameId, channel);
    return {{"CompressedImage", "image", std::move(picture)}};
  }
  const bool gray = image.format == image_t::FORMAT_GRAY8;
  picture.message(fg::RawImage::kTimestamp, fg::timestamp(image.utime));
  picture.fixed32(fg::RawImage::kWidth, static_cast<uint32_t>(image.width_px));
  picture.fixed32(fg::RawImage::kHeight, static_cast<uint32_t>(image.height_px));
  picture.text(fg::RawImage::kEncoding, gray ? "mono8" : "bgr8");
  picture.fixed32(fg::RawImage::kStep, static_cast<uint32_t>(image.width_px) * (gray ? 1U : 3U));
  picture.bytes(fg::RawImage::kData, data);
  picture.text(fg::RawImage::kFrameId, channel);
  return {{"RawImage", "image", std::move(picture)}};
}

/// Points by their use, and a line from where each track was in the picture before.
FoxgloveViews FoxgloveViewer::views(const std::string& /*channel*/, const vo_features_t& features) {
  struct Look {
    int8_t use;
    std::initializer_list<double> rgba;
  };
  const Look looks[] = {{vo_features_t::USE_NEW, {0.3, 0.6, 1.0, 1.0}},
                        {vo_features_t::USE_MATCHED, {1.0, 0.9, 0.2, 1.0}},
                        {vo_features_t::USE_INLIER, {0.2, 0.9, 0.3, 1.0}},
                        {vo_features_t::USE_OUTLIER, {0.95, 0.2, 0.2, 1.0}}};
  constexpr double kPointSize = 4.0, kLineWidth = 1.0;  // px
  ProtobufMessage all;
  const auto count = static_cast<std::size_t>(features.num_features);
  for (const Look& look : looks) {
    ProtobufMessage points, lines;
    bool any = false;
    for (std::size_t i = 0; i < count; ++i) {
      if (features.use[i] != look.use) continue;
      const double u = features.u_px[i], v = features.v_px[i];
      points.vector(fg::PointsAnnotation::kPoints, {u, v});
      const auto before = last_points_.find(features.track_id[i]);
      if (before != last_points_.end()) {
        lines.vector(fg::PointsAnnotation::kPoints, {before->second.first, before->second.second});
        lines.vector(fg::PointsAnnotation::kPoints, {u, v});
        any = true;
      }
    }
    if (points.empty()) continue;
    const auto add = [&](ProtobufMessage& shape, uint64_t type, double thickness) {
      shape.message(fg::PointsAnnotation::kTimestamp, fg::timestamp(features.utime));
      shape.varint(fg::PointsAnnotation::kType, type);
      shape.vector(fg::PointsAnnotation::kOutlineColor, look.rgba);
      shape.number(fg::PointsAnnotation::kThickness, thickness);
      all.message(fg::ImageAnnotations::kPoints, shape);
    };
    add(points, fg::PointsAnnotation::kPointsType, kPointSize);
    if (any) add(lines, fg::PointsAnnotation::kLineList, kLineWidth);
  }
  last_points_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    last_points_[features.track_id[i]] = {features.u_px[i], features.v_px[i]};
  }
  if (all.empty()) return {};
  return {{"ImageAnnotations", "annotations", std::move(all)}};
}

FoxgloveViews FoxgloveViewer::views(const std::string& /*channel*/, const health_t& health) {
  if (last_verdict_ == health.verdict) return {};
  last_verdict_ = health.verdict;
  const uint64_t levels[] = {fg::Log::kInfo, fg::Log::kWarning, fg::Log::kError};
  const char* const words[] = {"ok", "degraded", "do not use"};
  const uint64_t level = levels[std::clamp<int>(health.verdict, 0, 2)];
  const std::string text = fmt::format("{}: {}", name_of(words, health.verdict), fmt::join(health.reason, "; "));
  return {{"Log", "/log", log_line(health.utime, level, "monitor", text)}};
}

FoxgloveViews FoxgloveViewer::views(const std::string& channel, const ledger_t& ledger) {
  const char* const kinds[] = {"lost",    "late",          "undecodable", "refused",
                               "skipped", "clock changed", "run began",   "unused feedback"};
  FoxgloveViews views;
  auto& [run, last] = last_entries_[channel];
  if (run != ledger.run) last = 0;
  run = ledger.run;
  for (const ledger_entry_t& entry : ledger.entries) {
    if (entry.entry <= last) continue;
    last = entry.entry;
    const bool plain = entry.kind == ledger_entry_t::KIND_RUN_BEGAN || entry.kind == ledger_entry_t::KIND_CLOCK_CHANGED;
    const std::string text = fmt::format("{}: {}, seq {} to {} of run {}", entry.channel, name_of(kinds, entry.kind),
                                         entry.first_seq, entry.last_seq, entry.input_run);
    views.push_back({"Log", "/log", log_line(ledger.utime, plain ? fg::Log::kInfo : fg::Log::kWarning, channel, text)});
  }
  return views;
}

}  // namespace roadfix
