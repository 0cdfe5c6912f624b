#include "roadfix/import/text_table.h"

#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "config/config_error.h"
#include "config/scalar.h"
#include "roadfix/import/csv_reader.h"

namespace roadfix {

std::vector<TextRow> read_text_table(const std::filesystem::path& path) {
  return parse_text_table(read_maybe_gzip(path), path.string());
}

std::vector<TextRow> parse_text_table(const std::string& text, const std::string& file) {
  constexpr std::string_view kBlanks = " \t\r,";
  std::vector<TextRow> rows;
  int line_number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = std::string_view(text).substr(at, end - at);
    at = end + 1;
    ++line_number;
    TextRow row{line_number, {}};
    std::size_t start = line.find_first_not_of(kBlanks);
    if (start == std::string_view::npos || line[start] == '#') continue;
    while (start != std::string_view::npos) {
      const std::size_t stop = std::min(line.find_first_of(kBlanks, start), line.size());
      const std::string_view word = line.substr(start, stop - start);
      const auto value = parse_double(word);
      if (!value || !std::isfinite(*value)) {
        std::string shown(word.substr(0, 40));
        for (char& c : shown) c = c >= ' ' && c < 0x7f ? c : '?';
        throw ConfigError(file, line_number,
                          fmt::format("field {} = {}: is not a finite number", row.numbers.size() + 1, shown));
      }
      row.numbers.push_back(*value);
      start = line.find_first_not_of(kBlanks, stop);
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) throw ConfigError(file, 0, "holds no numbers");
  return rows;
}

int64_t SecondsColumn::next(double seconds, int line) {
  constexpr double kLatest = 4102444800.0;  // s, 2100-01-01
  if (!(seconds >= 0.0 && seconds <= kLatest)) {
    throw ConfigError(
        file_, line, fmt::format("time = {} s: is out of range; allowed: 0 to {}", to_text(seconds), to_text(kLatest)));
  }
  const int64_t t_us = std::llround(seconds * 1e6);
  if (any_ && t_us < last_us_) {
    throw ConfigError(
        file_, line,
        fmt::format("time = {} s: time runs backwards, the row before has {} us", to_text(seconds), last_us_));
  }
  any_ = true;
  last_us_ = t_us;
  return t_us;
}

}  // namespace roadfix
