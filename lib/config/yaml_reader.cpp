#include "config/yaml_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/config_error.h"
#include "config/key_hint.h"
#include "config/scalar.h"

namespace roadfix {

YamlReader::YamlReader(const YamlNode& map, const std::string& file, std::string path)
    : map_(map), file_(file), path_(std::move(path)) {}

void YamlReader::number(const char* key, double& value, double min, double max) {
  if (const YamlNode* node = find(key)) value = read_number(*node, join(key), min, max);
}

void YamlReader::boolean(const char* key, bool& value) {
  if (const YamlNode* node = find(key)) value = read_boolean(*node, join(key));
}

void YamlReader::text(const char* key, std::string& value) {
  if (const YamlNode* node = find(key)) value = read_text(*node, join(key));
}

void YamlReader::optional_number(const char* key, std::optional<double>& value, double min, double max) {
  if (const YamlNode* node = find(key)) value = read_number(*node, join(key), min, max);
}

void YamlReader::optional_boolean(const char* key, std::optional<bool>& value) {
  if (const YamlNode* node = find(key)) value = read_boolean(*node, join(key));
}

void YamlReader::optional_text(const char* key, std::optional<std::string>& value) {
  if (const YamlNode* node = find(key)) value = read_text(*node, join(key));
}

void YamlReader::numbers(const char* key, std::vector<double>& values, double min, double max) {
  const YamlNode* node = find_list(key);
  if (node == nullptr) return;
  values.clear();
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    values.push_back(read_number(node->items[i], join(key, i), min, max));
  }
}

void YamlReader::integers(const char* key, std::vector<int64_t>& values, int64_t min, int64_t max) {
  const YamlNode* node = find_list(key);
  if (node == nullptr) return;
  values.clear();
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    values.push_back(read_integer(node->items[i], join(key, i), min, max));
  }
}

void YamlReader::texts(const char* key, std::vector<std::string>& values) {
  const YamlNode* node = find_list(key);
  if (node == nullptr) return;
  values.clear();
  for (std::size_t i = 0; i < node->items.size(); ++i) values.push_back(read_text(node->items[i], join(key, i)));
}

void YamlReader::require(const char* key) {
  if (find(key) != nullptr) return;
  for (std::size_t i = 0; i < map_.keys.size(); ++i) {
    if (differ_in_unit_only(map_.keys[i], key)) {
      throw ConfigError(file_, map_.items[i].line,
                        fmt::format("{} is unknown, did you mean {}?", join(map_.keys[i].c_str()), key));
    }
  }
  throw ConfigError(file_, map_.line, fmt::format("{} is missing", join(key)));
}

void YamlReader::check(const char* key, bool ok, const std::string& what) {
  if (ok) return;
  const YamlNode* node = map_.find(key);
  if (node == nullptr) throw ConfigError(file_, map_.line, fmt::format("{} (absent): {}", join(key), what));
  fail(*node, join(key), what);
}

void YamlReader::finish() const {
  for (std::size_t i = 0; i < map_.keys.size(); ++i) {
    const std::string& key = map_.keys[i];
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    const std::string hint = closest_key(key, known_);
    std::string message = join(key.c_str()) + " is unknown";
    if (!hint.empty()) {
      message += ", did you mean " + hint + "?";
    } else if (!known_.empty()) {
      message += fmt::format("; known here: {}", fmt::join(known_, ", "));
    }
    throw ConfigError(file_, map_.items[i].line, message);
  }
}

const YamlNode* YamlReader::find(const char* key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.emplace_back(key);
  return map_.find(key);
}

const YamlNode* YamlReader::find_list(const char* key) {
  const YamlNode* node = find(key);
  if (node != nullptr) expect(*node, join(key), YamlNode::Kind::kList, "a list");
  return node;
}

std::string YamlReader::join(const char* key) const { return path_.empty() ? key : path_ + "." + key; }

std::string YamlReader::join(const char* key, std::size_t index) const {
  return fmt::format("{}[{}]", join(key), index);
}

void YamlReader::fail(const YamlNode& node, const std::string& path, const std::string& what) const {
  throw ConfigError(file_, node.line, fmt::format("{} = {}: {}", path, describe(node), what));
}

void YamlReader::fail_choice(const YamlNode& node, const std::string& path,
                             const std::vector<std::string>& allowed) const {
  fail(node, path, fmt::format("must be one of {}", fmt::join(allowed, ", ")));
}

void YamlReader::expect(const YamlNode& node, const std::string& path, YamlNode::Kind kind, const char* what) const {
  if (node.kind != kind) fail(node, path, fmt::format("must be {}", what));
}

double YamlReader::read_number(const YamlNode& node, const std::string& path, double min, double max) const {
  const auto allowed = [&] { return fmt::format("{} to {}", to_text(min), to_text(max)); };
  const auto value =
      node.kind == YamlNode::Kind::kScalar && !node.quoted ? parse_double(node.scalar) : std::optional<double>();
  if (!value) fail(node, path, "is not a number; allowed: " + allowed());
  if (!std::isfinite(*value)) fail(node, path, "is not a finite number; allowed: " + allowed());
  if (*value < min || *value > max) fail(node, path, "is out of range; allowed: " + allowed());
  return *value;
}

int64_t YamlReader::read_integer(const YamlNode& node, const std::string& path, int64_t min, int64_t max) const {
  const auto value =
      node.kind == YamlNode::Kind::kScalar && !node.quoted ? parse_integer(node.scalar) : std::optional<int64_t>();
  if (!value) fail(node, path, fmt::format("is not a whole number; allowed: {} to {}", min, max));
  if (*value < min || *value > max) fail(node, path, fmt::format("is out of range; allowed: {} to {}", min, max));
  return *value;
}

bool YamlReader::read_boolean(const YamlNode& node, const std::string& path) const {
  if (node.kind == YamlNode::Kind::kScalar && !node.quoted) {
    if (node.scalar == "true") return true;
    if (node.scalar == "false") return false;
  }
  fail(node, path, "must be true or false");
}

std::string YamlReader::read_text(const YamlNode& node, const std::string& path) const {
  expect(node, path, YamlNode::Kind::kScalar, "text");
  return node.scalar;
}

std::vector<double> YamlReader::read_numbers(const YamlNode& node, const std::string& path, int rows, int columns,
                                             double min, double max) const {
  const auto count = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  expect(node, path, YamlNode::Kind::kList, fmt::format("a list of {} numbers", count).c_str());
  const bool nested = columns > 1 && !node.items.empty() && node.items.front().kind == YamlNode::Kind::kList;
  const std::size_t expected = nested ? static_cast<std::size_t>(rows) : count;
  if (node.items.size() != expected) {
    fail(node, path, fmt::format("has {} entries, must have {}{}", node.items.size(), expected, nested ? " rows" : ""));
  }
  std::vector<double> values;
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    const std::string item = fmt::format("{}[{}]", path, i);
    if (nested) {
      for (const double value : read_numbers(node.items[i], item, columns, 1, min, max)) values.push_back(value);
    } else {
      values.push_back(read_number(node.items[i], item, min, max));
    }
  }
  return values;
}

}  // namespace roadfix
