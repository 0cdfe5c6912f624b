#include "roadfix/import/drive_reference.h"

#include <algorithm>
#include <unordered_map>

#include "roadfix/import/drive_messages.h"

namespace roadfix {
namespace {

constexpr double kSamePlace = 0.02;  ///< m: the resolution in which receivers and tools write positions
constexpr double kSameShare = 0.9;   ///< of the reference's points

using FixByTime = std::unordered_map<int64_t, const GnssFix*>;

bool repeats_fixes(const std::vector<ReferencePoint>& reference, const FixByTime& fixes) {
  std::size_t same = 0;
  for (const ReferencePoint& point : reference) {
    const auto fix = fixes.find(point.t_us);
    if (fix == fixes.end()) continue;
    const Eigen::Vector3d apart = ecef_from_geodetic(point.position) - ecef_from_geodetic(fix->second->antenna);
    if (apart.norm() <= kSamePlace) ++same;
  }
  return static_cast<double>(same) >= kSameShare * static_cast<double>(reference.size());
}

std::vector<ReferencePoint> points_from(const std::vector<GnssFix>& fixes) {
  std::vector<ReferencePoint> points;
  for (const GnssFix& fix : fixes) {
    if (fix.fix_type == FixType::kNone) continue;
    std::optional<Eigen::Vector3d> velocity;
    if (fix.velocity) velocity = fix.velocity->enu;
    points.push_back({fix.t_us, fix.antenna, velocity, std::nullopt});
  }
  return points;
}

/// Which poses are scored, and which fixes the estimators never saw.
void mark(const FixByTime& fixes, const ChangedGnss& changed, const std::vector<FixType>& scored,
          std::vector<pose_t>& poses) {
  for (pose_t& pose : poses) {
    const auto& withheld = changed.withheld_utimes;
    if (std::binary_search(withheld.begin(), withheld.end(), pose.utime)) pose.reason = kWithheld;
    const auto fix = fixes.find(pose.utime);
    if (fix == fixes.end() || scored.empty()) continue;
    if (std::find(scored.begin(), scored.end(), fix->second->fix_type) == scored.end()) {
      pose.validity = pose_t::VALIDITY_INVALID;
    }
  }
}

void add_geographic(const std::vector<ReferencePoint>& points, DriveReference& result) {
  if (points.empty()) return;
  const EnuAnchor anchor(points.front().position);
  const ReferenceFacts& facts = result.facts.reference;
  for (const ReferencePoint& point : points) {
    result.poses.push_back(to_message(point, anchor, facts.of, facts.sigma_m));
  }
}

}  // namespace

DriveReference make_reference(const Drive& drive, const ChangedGnss& changed, const GnssChanges& changes) {
  const DriveDescription& description = drive.description;
  DriveReference result;
  DriveFacts& facts = result.facts;
  facts.name = description.name;
  facts.score = description.score;
  facts.outages = changed.outages;
  facts.reference.of = description.reference.of;
  facts.reference.attitude = description.reference.attitude;
  facts.reference.sigma_m = description.reference.sigma;

  FixByTime fixes;
  for (const GnssFix& fix : drive.gnss) fixes.emplace(fix.t_us, &fix);
  if (!drive.local_reference.empty()) {
    facts.reference.velocity = drive.local_reference.front().velocity_local.has_value();
    for (const LocalPose& pose : drive.local_reference) {
      result.poses.push_back(to_message(pose, facts.reference.of, facts.reference.sigma_m));
    }
  } else if (!drive.reference.empty()) {
    facts.reference.velocity = drive.reference.front().velocity_enu.has_value();
    facts.reference.from_fixes = repeats_fixes(drive.reference, fixes);
    add_geographic(drive.reference, result);
  } else if (!drive.gnss.empty()) {
    const std::vector<ReferencePoint> points = points_from(drive.gnss);
    facts.reference = {ReferenceOf::kAntenna, false, false, true, description.reference.sigma};
    facts.reference.velocity = !points.empty() && points.front().velocity_enu.has_value();
    add_geographic(points, result);
  } else {
    facts.reference = {};
  }
  facts.score_withheld_only = changes.keep_every > 1 && facts.reference.from_fixes;
  mark(fixes, changed, facts.score.fix_types, result.poses);
  if (!drive.gnss.empty()) {
    facts.first_fix_us = drive.gnss.front().t_us;
  } else if (!result.poses.empty()) {
    facts.first_fix_us = result.poses.front().utime;
  }
  return result;
}

}  // namespace roadfix
