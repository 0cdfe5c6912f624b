/// What lies beside a recording so that it can be read in ten years: type definitions, fingerprints, versions,
/// contents.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace roadfix {

struct SidecarFile {
  std::string name;
  int64_t first_us = 0;
  int64_t last_us = 0;
  uint64_t bytes = 0;
  uint64_t hash = 0;                      ///< XXH64; 0 while it is being written
  std::map<std::string, int64_t> events;  ///< per channel
};

struct Sidecar {
  std::vector<SidecarFile> files;
  int64_t deleted_files = 0;               ///< before these, for want of room (when_full: delete_oldest)
  std::map<std::string, int64_t> dropped;  ///< per channel: did not fit into memory while the disk was slow
  int64_t unwritten = 0;                   ///< came after the recording had stopped
  std::string stopped_because;             ///< empty: stopped on request, or still running
};

/// Adds type texts, fingerprints, library versions and host, and replaces `path` in one step; a disk that takes no more
/// is no error here, since the logs matter more.
void write_sidecar(const std::filesystem::path& path, const Sidecar& sidecar);

}  // namespace roadfix
