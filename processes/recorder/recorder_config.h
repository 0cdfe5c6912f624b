/// configs/VEHICLE/recorder.yaml: where a drive is recorded to, and what happens when space gets short.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace roadfix {

/// What to do when the quota is used up: stop, so that nothing recorded is lost, or go on like a dash cam.
enum class WhenFull { kStop, kDeleteOldest };

struct RecorderConfig {
  std::string name = "recorder";  ///< of the process; on two hosts with a recorder on each, one has another
  std::string folder = "recordings";
  std::string channels = ".*";  ///< POSIX extended regular expression over the whole name
  double split_size = 1024.0;   ///< MiB of one file
  double split_time = 600.0;    ///< s of one file
  double quota = 0.0;           ///< GiB of all recordings in the folder; 0: no quota
  double min_free = 1.0;        ///< GiB left on the disk, below which recording stops
  WhenFull when_full = WhenFull::kStop;
  double memory = 512.0;        ///< MiB of messages that wait for the disk
  double flush_interval = 0.2;  ///< s after which what was received is on the disk
};

template <class Visitor>
void visit(RecorderConfig& c, Visitor& v) {
  v.text("name", c.name);
  v.text("folder", c.folder);
  v.text("channels", c.channels);
  v.number("split_size_mib", c.split_size, 1.0, 1048576.0);
  v.number("split_time_s", c.split_time, 1.0, 864000.0);
  v.number("quota_gib", c.quota, 0.0, 1048576.0);
  v.number("min_free_gib", c.min_free, 0.0, 1048576.0);
  v.choice("when_full", c.when_full, {{"stop", WhenFull::kStop}, {"delete_oldest", WhenFull::kDeleteOldest}});
  v.number("memory_mib", c.memory, 1.0, 65536.0);
  v.number("flush_interval_s", c.flush_interval, 0.0, 60.0);
}

inline constexpr double kMebi = 1024.0 * 1024.0;
inline constexpr double kGibi = 1024.0 * kMebi;

}  // namespace roadfix
