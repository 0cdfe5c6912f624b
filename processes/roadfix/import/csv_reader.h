/// Strict CSV, plain or gzip: columns by name, every field checked, every error with file, line and value
/// (ConfigError). Numbers are read by std::from_chars: no locale, correctly rounded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace roadfix {

/// Which columns a file may have; an optional group is there as a whole or not at all.
struct CsvColumns {
  std::vector<std::string> required;
  std::vector<std::vector<std::string>> optional_groups = {};
};

class CsvReader {
 public:
  /// Reads the file and its header.
  CsvReader(const std::filesystem::path& path, const CsvColumns& columns);
  /// The same from memory; `file` is what errors call it.
  CsvReader(std::string text, std::string file, const CsvColumns& columns);

  [[nodiscard]] bool has(std::string_view column) const;
  /// For number(), integer() and text(); the column must be there.
  [[nodiscard]] int index(std::string_view column) const;

  /// Steps to the next row, false at the end. A file without rows is an error, blank lines at its end are not.
  bool next();

  /// Fields of the current row; a number is finite and within [min, max].
  [[nodiscard]] double number(int column, double min, double max) const;
  [[nodiscard]] int64_t integer(int column, int64_t min, int64_t max) const;
  [[nodiscard]] std::string_view text(int column) const;
  /// The time in `column`, microseconds since 1970 up to 2100; never earlier than the row's before. A file of another
  /// unit says how many of it make a microsecond.
  [[nodiscard]] int64_t utime(int column, int64_t units_per_microsecond = 1);

  /// Throws ConfigError naming file, line, column and value of the current row.
  [[noreturn]] void fail(int column, const std::string& what) const;
  [[noreturn]] void fail(const std::string& what) const;

  [[nodiscard]] int line() const { return line_; }
  [[nodiscard]] const std::string& file() const { return file_; }
  /// A guess at the number of rows, from the file's size.
  [[nodiscard]] std::size_t expected_rows() const;

 private:
  void read_header(const CsvColumns& columns);
  void check_header(const CsvColumns& columns) const;
  bool take_line(std::string_view& line);
  void split(std::string_view line);

  std::string file_;
  std::string content_;
  std::size_t position_ = 0;
  int line_ = 0;
  bool any_row_ = false;
  int64_t last_utime_;
  std::vector<std::string> names_;
  std::vector<std::string_view> fields_;
};

/// The whole file, unpacked where it is gzip; ConfigError where it is missing, damaged or longer than 2 GB.
std::string read_maybe_gzip(const std::filesystem::path& path);

}  // namespace roadfix
