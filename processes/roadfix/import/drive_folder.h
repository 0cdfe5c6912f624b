/// Reads a drive folder: drive.yaml, CSV files plain or gzip, pictures. docs/IMPORT.md.
#pragma once

#include <filesystem>
#include <string>

#include "roadfix/import/drive.h"

namespace roadfix {

using DriveFolder = Drive;

/// Strict: an unknown file, key or column, a wrong number of fields, time that runs backwards, NaN, a value out of
/// range, a missing picture is a ConfigError that names the file, the line and the value. An absent file is an absent
/// sensor. Where gnss.csv has a velocity without std_vel_mps, its covariance is zero: the receiver did not say.
/// Wheel speeds count as signed where any of the file is negative; otherwise their direction is unknown.
DriveFolder read_drive_folder(const std::filesystem::path& folder);

/// drive.yaml alone.
DriveDescription parse_drive_description(const std::string& text, const std::string& file);

}  // namespace roadfix
