/// Files of numbers between blanks, one row a line, without header: KITTI's poses and times, TUM trajectories.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace roadfix {

struct TextRow {
  int line = 0;
  std::vector<double> numbers;
};

/// Every row's numbers, all finite; blank lines and lines that start with # are stepped over. Rows may differ in
/// length. ConfigError with file, line and value; an empty file is one.
std::vector<TextRow> read_text_table(const std::filesystem::path& path);
std::vector<TextRow> parse_text_table(const std::string& text, const std::string& file);

/// Seconds as microseconds, rounded; ConfigError where that does not fit, or is before the previous time.
class SecondsColumn {
 public:
  explicit SecondsColumn(std::string file) : file_(std::move(file)) {}
  int64_t next(double seconds, int line);

 private:
  std::string file_;
  bool any_ = false;
  int64_t last_us_ = 0;
};

}  // namespace roadfix
