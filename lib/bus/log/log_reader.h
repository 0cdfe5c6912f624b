/// Reads LCM event logs, also damaged ones: what is broken is stepped over and reported, what is intact comes back.
#pragma once

#include <string>
#include <vector>

#include "bus/log/log_file.h"

namespace roadfix {

/// Bytes of the file that belong to no intact event.
struct LogDamage {
  uint64_t offset = 0;
  uint64_t bytes = 0;
  std::string what;
};

/// The file is mapped: events point into it and stay valid as long as the reader lives.
class LogReader {
 public:
  /// Throws LogError where the file cannot be opened. An empty file is a log without events.
  explicit LogReader(const std::filesystem::path& path);
  /// Over bytes in memory, which must outlive it; `name` is what path() says.
  LogReader(std::span<const uint8_t> bytes, const std::string& name) : path_(name), file_(bytes) {}
  ~LogReader();
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;

  /// The next intact event in file order; nothing at the end.
  std::optional<LogEvent> next();

  /// The event at an offset that an earlier next() reported.
  [[nodiscard]] LogEvent at(uint64_t offset) const;

  void rewind() { position_ = 0; }

  /// Throws LogError, saying what the file is instead, where it holds no event at all. Stands at the beginning then.
  void require_events();

  /// What next() has stepped over so far, in file order, each once.
  [[nodiscard]] const std::vector<LogDamage>& damage() const { return damage_; }
  [[nodiscard]] uint64_t size_bytes() const { return file_.size(); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  uint64_t find_event(uint64_t from) const;
  void note_damage(uint64_t begin, uint64_t end, const std::string& what);

  std::filesystem::path path_;
  std::span<const uint8_t> file_;
  bool mapped_ = false;
  uint64_t position_ = 0;
  std::vector<LogDamage> damage_;
};

}  // namespace roadfix
