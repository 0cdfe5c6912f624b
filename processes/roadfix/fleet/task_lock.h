/// One process at a time: a lock file that says who holds it. Where the file system has no locks nobody is kept out.
#pragma once

#include <filesystem>
#include <string>

namespace roadfix {

class TaskLock {
 public:
  explicit TaskLock(const std::filesystem::path& path);
  ~TaskLock();
  TaskLock(const TaskLock&) = delete;
  TaskLock& operator=(const TaskLock&) = delete;

  [[nodiscard]] bool held() const { return held_; }
  /// Writes who holds it: host, process, time.
  void sign() const;
  /// As if nobody had begun.
  void unsign() const;

  /// What the last holder wrote; empty where there is no lock file.
  static std::string signature(const std::filesystem::path& path);
  /// Whether somebody holds it.
  static bool is_taken(const std::filesystem::path& path);

 private:
  int fd_ = -1;
  bool held_ = false;
};

std::string host_name();
/// 2026-11-24T20:00:00Z
std::string utc_now();

}  // namespace roadfix
