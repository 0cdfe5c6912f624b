#include "roadfix/import/csv_reader.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "config/config_error.h"
#include "config/key_hint.h"
#include "config/scalar.h"

namespace roadfix {
namespace {

constexpr int64_t kLatestUtime = 4102444800000000;  // 2100-01-01, microseconds; nanoseconds lie far beyond it

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string shown(std::string_view text) {
  constexpr std::size_t kShown = 40;
  std::string clean;
  for (const char c : text.substr(0, kShown)) clean += (c >= ' ' && c < 0x7f) ? c : '?';
  return text.size() > kShown ? clean + "..." : clean;
}

std::vector<std::string> all_names(const CsvColumns& columns) {
  std::vector<std::string> names = columns.required;
  for (const auto& group : columns.optional_groups) names.insert(names.end(), group.begin(), group.end());
  return names;
}

/// Closes on every way out.
class GzipFile {
 public:
  explicit GzipFile(const std::filesystem::path& path) : file_(gzopen(path.c_str(), "rb")) {}
  GzipFile(const GzipFile&) = delete;
  GzipFile& operator=(const GzipFile&) = delete;
  ~GzipFile() {
    if (file_ != nullptr) gzclose_r(file_);
  }
  [[nodiscard]] gzFile get() const { return file_; }
  /// Empty where all is well; a stream cut short shows only here.
  [[nodiscard]] std::string error() const {
    int code = Z_OK;
    const char* text = gzerror(file_, &code);
    return code == Z_OK || code == Z_STREAM_END ? "" : text;
  }

 private:
  gzFile file_;
};

}  // namespace

std::string read_maybe_gzip(const std::filesystem::path& path) {
  constexpr std::size_t kMaxBytes = std::size_t{1} << 31U;
  constexpr unsigned kChunk = 1U << 20U;
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw ConfigError(path.string(), 0, "no such file");
  if (!std::filesystem::is_regular_file(path, ignored)) throw ConfigError(path.string(), 0, "is not a file");
  const GzipFile file(path);
  if (file.get() == nullptr) throw ConfigError(path.string(), 0, "cannot be read");
  gzbuffer(file.get(), kChunk);
  std::string text;
  while (true) {
    const std::size_t start = text.size();
    text.resize(start + kChunk);
    const int count = gzread(file.get(), text.data() + start, kChunk);
    text.resize(start + static_cast<std::size_t>(std::max(count, 0)));
    const std::string error = file.error();
    if (!error.empty()) throw ConfigError(path.string(), 0, "is damaged or cut short (" + error + ")");
    if (count <= 0) return text;
    if (text.size() > kMaxBytes) throw ConfigError(path.string(), 0, "is longer than 2 GB");
  }
}

CsvReader::CsvReader(const std::filesystem::path& path, const CsvColumns& columns)
    : CsvReader(read_maybe_gzip(path), path.string(), columns) {}

CsvReader::CsvReader(std::string text, std::string file, const CsvColumns& columns)
    : file_(std::move(file)), content_(std::move(text)), last_utime_(std::numeric_limits<int64_t>::min()) {
  read_header(columns);
}

void CsvReader::read_header(const CsvColumns& columns) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (content_.starts_with(kByteOrderMark)) position_ = kByteOrderMark.size();
  std::string_view header;
  if (!take_line(header) || trimmed(header).empty()) {
    throw ConfigError(file_, 1, fmt::format("needs a header line: {}", fmt::join(columns.required, ",")));
  }
  split(header);
  for (const std::string_view field : fields_) names_.emplace_back(field);
  check_header(columns);
}

void CsvReader::check_header(const CsvColumns& columns) const {
  const std::vector<std::string> known = all_names(columns);
  const auto present = [&](const std::string& name) { return has(name); };
  for (const std::string& name : names_) {
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::string hint = closest_key(name, known);
      throw ConfigError(file_, line_,
                        fmt::format("column {} is unknown{}", shown(name),
                                    hint.empty() ? fmt::format("; known: {}", fmt::join(known, ", "))
                                                 : fmt::format(", did you mean {}?", hint)));
    }
    if (std::count(names_.begin(), names_.end(), name) > 1) {
      throw ConfigError(file_, line_, fmt::format("column {} is there twice", name));
    }
  }
  for (const std::string& name : columns.required) {
    if (!has(name)) throw ConfigError(file_, line_, fmt::format("column {} is missing", name));
  }
  for (const auto& group : columns.optional_groups) {
    if (std::none_of(group.begin(), group.end(), present)) continue;
    for (const std::string& name : group) {
      if (has(name)) continue;
      throw ConfigError(file_, line_,
                        fmt::format("column {} is missing: {} come together", name, fmt::join(group, ", ")));
    }
  }
}

bool CsvReader::has(std::string_view column) const {
  return std::find(names_.begin(), names_.end(), column) != names_.end();
}

int CsvReader::index(std::string_view column) const {
  const auto found = std::find(names_.begin(), names_.end(), column);
  if (found == names_.end()) throw ConfigError(file_, 1, fmt::format("column {} is missing", column));
  return static_cast<int>(found - names_.begin());
}

bool CsvReader::take_line(std::string_view& line) {
  if (position_ >= content_.size()) return false;
  const std::size_t end = std::min(content_.find('\n', position_), content_.size());
  line = std::string_view(content_).substr(position_, end - position_);
  position_ = end + 1;
  ++line_;
  return true;
}

void CsvReader::split(std::string_view line) {
  fields_.clear();
  std::size_t start = 0;
  while (true) {
    const std::size_t comma = line.find(',', start);
    fields_.push_back(trimmed(line.substr(start, comma == std::string_view::npos ? comma : comma - start)));
    if (comma == std::string_view::npos) return;
    start = comma + 1;
  }
}

bool CsvReader::next() {
  std::string_view line;
  while (take_line(line)) {
    if (trimmed(line).empty()) {
      if (content_.find_first_not_of(" \t\r\n", position_) != std::string::npos) fail("is empty");
      continue;
    }
    split(line);
    if (fields_.size() != names_.size()) {
      fail(fmt::format("has {} fields, the header has {}: {}", fields_.size(), names_.size(), shown(line)));
    }
    any_row_ = true;
    return true;
  }
  if (!any_row_) {
    throw ConfigError(file_, line_, "has a header but no rows; where there is no such sensor leave the file out");
  }
  return false;
}

double CsvReader::number(int column, double min, double max) const {
  const auto value = parse_double(text(column));
  if (!value) fail(column, "is not a number");
  if (!std::isfinite(*value)) fail(column, "is not a finite number");
  if (*value < min || *value > max) {
    fail(column, fmt::format("is out of range; allowed: {} to {}", to_text(min), to_text(max)));
  }
  return *value;
}

int64_t CsvReader::integer(int column, int64_t min, int64_t max) const {
  const auto value = parse_integer(text(column));
  if (!value) fail(column, "is not a whole number");
  if (*value < min || *value > max) fail(column, fmt::format("is out of range; allowed: {} to {}", min, max));
  return *value;
}

std::string_view CsvReader::text(int column) const { return fields_[static_cast<std::size_t>(column)]; }

int64_t CsvReader::utime(int column, int64_t units_per_microsecond) {
  const int64_t t_us = integer(column, 0, kLatestUtime * units_per_microsecond) / units_per_microsecond;
  if (t_us < last_utime_) fail(column, fmt::format("time runs backwards, the row before has {} us", last_utime_));
  last_utime_ = t_us;
  return t_us;
}

void CsvReader::fail(int column, const std::string& what) const {
  fail(fmt::format("{} = {}: {}", names_[static_cast<std::size_t>(column)], shown(text(column)), what));
}

void CsvReader::fail(const std::string& what) const { throw ConfigError(file_, line_, what); }

std::size_t CsvReader::expected_rows() const {
  const std::size_t first_row = std::min(position_, content_.size());
  const std::size_t end = std::min(content_.find('\n', first_row), content_.size());
  return end > first_row ? (content_.size() - first_row) / (end - first_row) + 1 : 0;
}

}  // namespace roadfix
