/// Messages of the GNSS/INS process to and from lib/gnss_ins: units and enums, nothing else.
#pragma once

#include <roadfix/aiding_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/pose_t.hpp>

#include "gnss_ins/gnss_ins.h"

namespace roadfix {

GnssFix gnss_fix(const gnss_t& message);
void fill_ins_pose(const GnssInsOutput& output, const std::optional<Geodetic>& anchor, pose_t& pose);
ins_status_t ins_status(const GnssInsStatus& status, const InsCore* core, const GnssInsVehicle& vehicle);
aiding_t aiding(const AidingRecord& record);

}  // namespace roadfix
