/// The main of every driver: live, or over the raw bytes of a log.
///   DRIVER --config DIR [--bus URL] [--device DEVICE] [--realtime PRIORITY]
///   DRIVER --config DIR --log-in LOG --log-out LOG      the sensor messages again from RAW_<DEVICE>
///   DRIVER --config DIR --print-config
#pragma once

#include <filesystem>

#include "drivers/device/driver.h"

namespace roadfix {

struct DriverProgram {
  std::string name;
  std::string description;
  std::string footer;  ///< of --help: devices, an example
  /// `device` replaces the configured one where it is not empty. Throws what the configuration's reader throws.
  std::function<DriverSetup(const std::filesystem::path& vehicle_dir, const std::string& device)> read;
};

/// The exit status: 0, or 2 for what the user can mend (printed to stderr).
int run_driver(int argc, char** argv, const DriverProgram& program);

struct DriverReplay {
  int64_t raw = 0;       ///< raw messages read
  int64_t lost = 0;      ///< that are missing between them
  int64_t messages = 0;  ///< written
};

/// The messages of `in`'s raw bytes into `out`, which holds nothing else.
DriverReplay replay_driver(const std::filesystem::path& in, const std::filesystem::path& out, const DriverSetup& setup);

}  // namespace roadfix
