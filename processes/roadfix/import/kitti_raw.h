/// KITTI raw recordings (Geiger, Lenz, Stiller, Urtasun 2013): a DATE_drive_NNNN_sync or _extract folder with oxts and
/// image_00 to image_03, the day's calib_*.txt in it or in the folder above.
#pragma once

#include <filesystem>

#include "roadfix/import/drive.h"

namespace roadfix {

/// The body is the OXTS unit, its axes x forward, y left, z up. oxts is already the solution of a GNSS/INS unit: its
/// poses are the reference, its rates and accelerations the IMU. Fixes of GNSS alone are not in the recording;
/// `gnss_from_oxts` takes the unit's places and velocities for fixes, for want of them.
Drive read_kitti_raw(const std::filesystem::path& folder, bool gnss_from_oxts);

}  // namespace roadfix
