/// A drive as an LCM log that replay, evaluate and every other program of the project can use without its source.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "roadfix/import/drive.h"
#include "roadfix/import/gnss_changes.h"

namespace roadfix {

/// Names that --without takes.
const std::vector<std::string>& sensor_names();

struct ImportChanges {
  std::vector<std::string> without;  ///< of sensor_names()
  double start_after = 0.0;          ///< s after the first fix (without GNSS: the first sample); all before is left out
  std::optional<double> score_skip;  ///< s, in place of the source's own
  GnssChanges gnss;
};

struct DriveLogSummary {
  std::string text;  ///< what went in, one line per channel
  DriveFacts facts;
};

/// Called now and then with messages written and messages in all.
using Progress = std::function<void(std::size_t done, std::size_t all)>;

/// Writes the log under its name when it is complete, not before: sensor channels, REFERENCE, POSE_VO where the source
/// has an estimate, and one CONFIG_DRIVE. Every message carries the time of validity, run = the log's first utime, seq
/// from 0 without gaps; the order is (utime, channel, seq) with CONFIG_DRIVE first. The same drive and changes give the
/// same bytes. --start-after shortens the drive: windows, skip_s and decimation count from its new first fix.
DriveLogSummary write_drive_log(Drive drive, const ImportChanges& changes, const std::filesystem::path& path,
                                const Progress& progress);

/// DIR/calibration.yaml. An existing one that says something else is not overwritten unless `overwrite`.
void write_vehicle(const Calibration& calibration, const std::string& name, const std::filesystem::path& directory,
                   bool overwrite);

}  // namespace roadfix
