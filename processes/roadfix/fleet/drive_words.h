/// The drives of a fleet as words: what a command line, a list file and the run's own list of tasks say alike.
///
///   drive.lcm                                  a log
///   my_drive cut_gnss_s=60 every_s=180 phase_s=0,30,60
///                                              a recording that `roadfix import` reads, one drive a phase
///   tunnel_lit seeds=1..200 fault=none fault=gnss.bias@30+5:east_m=15/wheels.slip@40+2
///                                              a scenario, one drive a seed and fault; "/" joins faults of one drive
///   recordings                                 a folder of logs: each of them
///   `@drives.txt`                              a file with such words, one group a line, # before remarks
///
/// KEY=VALUE changes the drive that stands before it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "roadfix/import/drive_log.h"
#include "roadfix/simulate/scenario_request.h"

namespace roadfix {

enum class DriveKind { kLog, kRecording, kScenario };

/// One drive.
struct FleetDrive {
  DriveKind kind = DriveKind::kLog;
  std::filesystem::path path;  ///< of a log or recording, below the root or absolute
  ScenarioRequest scenario;
  std::uint64_t seed = 1;
  ImportChanges changes;  ///< of a recording
};

/// Words that name one drive each, in their order; paths are looked for below `root`. Throws std::runtime_error, naming
/// the word, for what is no drive, a key that is not the drive's, a value that is wrong, and a drive named twice.
std::vector<std::vector<std::string>> expand_drive_words(const std::vector<std::string>& words,
                                                         const std::filesystem::path& root);

/// The drive that one of those groups names.
FleetDrive parse_drive(const std::vector<std::string>& words, const std::filesystem::path& root);

/// "1..5,9" as numbers. Throws std::runtime_error where it is no such list, or one of more than a million.
std::vector<std::uint64_t> parse_number_list(const std::string& text);

}  // namespace roadfix
