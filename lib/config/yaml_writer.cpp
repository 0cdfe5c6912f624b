#include "config/yaml_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "config/scalar.h"

namespace roadfix {

void YamlWriter::number(const char* key, const double& value, double, double) { line(key, to_text(value)); }

void YamlWriter::boolean(const char* key, const bool& value) { line(key, value ? "true" : "false"); }

void YamlWriter::text(const char* key, const std::string& value) { line(key, yaml_scalar(value)); }

void YamlWriter::numbers(const char* key, const std::vector<double>& values, double, double) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(to_text(value));
  list_line(key, texts);
}

void YamlWriter::integers(const char* key, const std::vector<int64_t>& values, int64_t, int64_t) {
  std::vector<std::string> texts;
  for (const int64_t value : values) texts.push_back(std::to_string(value));
  list_line(key, texts);
}

void YamlWriter::texts(const char* key, const std::vector<std::string>& values) {
  std::vector<std::string> texts;
  for (const std::string& value : values) texts.push_back(yaml_scalar(value));
  list_line(key, texts);
}

std::string YamlWriter::text() const {
  if (lines_.empty()) return "{}\n";
  std::string all;
  for (const std::string& one : lines_) all += one + "\n";
  return all;
}

std::string YamlWriter::matrix_text(const std::vector<double>& flat, int columns) {
  std::string text = "[";
  for (std::size_t i = 0; i < flat.size(); ++i) {
    const std::size_t column = i % static_cast<std::size_t>(columns);
    if (i > 0) text += ", ";
    if (columns > 1 && column == 0) text += "[";
    text += to_text(flat[i]);
    if (columns > 1 && column + 1 == static_cast<std::size_t>(columns)) text += "]";
  }
  return text + "]";
}

void YamlWriter::line(const char* key, const std::string& value) {
  lines_.push_back(fmt::format("{}: {}", key, value));
}

void YamlWriter::list_line(const char* key, const std::vector<std::string>& values, const std::string& comment) {
  line(key, fmt::format("[{}]{}", fmt::join(values, ", "), comment));
}

void YamlWriter::block(const char* key, const std::vector<std::string>& lines) {
  if (lines.empty()) return line(key, "{}");
  lines_.push_back(fmt::format("{}:", key));
  for (const std::string& one : lines) lines_.push_back("  " + one);
}

void YamlWriter::block_list(const char* key, const std::vector<std::vector<std::string>>& blocks) {
  if (blocks.empty()) return line(key, "[]");
  lines_.push_back(fmt::format("{}:", key));
  for (const auto& lines : blocks) {
    if (lines.empty()) lines_.emplace_back("  - {}");
    for (std::size_t i = 0; i < lines.size(); ++i) lines_.push_back((i == 0 ? "  - " : "    ") + lines[i]);
  }
}

std::string yaml_scalar(const std::string& text) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view(" _./+-()").find(c) != std::string_view::npos;
  };
  const bool starts_with_letter =
      !text.empty() && ((text[0] >= 'a' && text[0] <= 'z') || (text[0] >= 'A' && text[0] <= 'Z'));
  const bool is_word = text != "null" && text != "Null" && text != "NULL" && text != "true" && text != "false";
  if (starts_with_letter && is_word && text.back() != ' ' && std::all_of(text.begin(), text.end(), plain)) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      quoted += fmt::format("\\x{:02x}", byte);
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

}  // namespace roadfix
