/// The visitor that fills a configuration struct from one YAML map, strictly. Users call config.h.
#pragma once

#include <Eigen/Dense>
#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "config/yaml_node.h"

namespace roadfix {

template <class E>
using ChoiceNames = std::initializer_list<std::pair<const char*, std::type_identity_t<E>>>;

/// Each method reads one key: absent leaves the value as it is; a wrong type, NaN or a value outside [min, max] throws
/// ConfigError with file, line, key path, value and allowed range. finish() throws for keys that nothing asked for.
class YamlReader {
 public:
  /// The three outlive the reader; `path` is that of the map, "" at the root.
  YamlReader(const YamlNode& map, const std::string& file, std::string path);

  void number(const char* key, double& value, double min, double max);
  template <std::integral T>
  void integer(const char* key, T& value, int64_t min, int64_t max) {
    if (const YamlNode* node = find(key)) value = static_cast<T>(read_integer(*node, join(key), min, max));
  }
  void boolean(const char* key, bool& value);
  void text(const char* key, std::string& value);
  template <class E>
  void choice(const char* key, E& value, ChoiceNames<E> names) {
    if (const YamlNode* node = find(key)) value = read_choice<E>(*node, join(key), names);
  }
  /// A list of N numbers for a vector; rows of numbers, or all numbers row by row, for a matrix.
  template <int R, int C>
  void vector(const char* key, Eigen::Matrix<double, R, C>& value, double min, double max) {
    if (const YamlNode* node = find(key)) read_matrix(*node, join(key), value, min, max);
  }

  void optional_number(const char* key, std::optional<double>& value, double min, double max);
  template <std::integral T>
  void optional_integer(const char* key, std::optional<T>& value, int64_t min, int64_t max) {
    optional(key, value, [&](T& v) { integer(key, v, min, max); });
  }
  void optional_boolean(const char* key, std::optional<bool>& value);
  void optional_text(const char* key, std::optional<std::string>& value);
  template <class E>
  void optional_choice(const char* key, std::optional<E>& value, ChoiceNames<E> names) {
    optional(key, value, [&](E& v) { choice(key, v, names); });
  }
  template <int R, int C>
  void optional_vector(const char* key, std::optional<Eigen::Matrix<double, R, C>>& value, double min, double max) {
    optional(key, value, [&](Eigen::Matrix<double, R, C>& v) { vector(key, v, min, max); });
  }

  /// Lists: of numbers, of integers, of choices, of texts, of groups. The list in the file replaces the default.
  void numbers(const char* key, std::vector<double>& values, double min, double max);
  void integers(const char* key, std::vector<int64_t>& values, int64_t min, int64_t max);
  void texts(const char* key, std::vector<std::string>& values);
  template <class E>
  void choices(const char* key, std::vector<E>& values, ChoiceNames<E> names) {
    const YamlNode* node = find_list(key);
    if (node == nullptr) return;
    values.clear();
    for (std::size_t i = 0; i < node->items.size(); ++i) {
      values.push_back(read_choice<E>(node->items[i], join(key, i), names));
    }
  }
  template <class T>
  void groups(const char* key, std::vector<T>& values) {
    const YamlNode* node = find_list(key);
    if (node == nullptr) return;
    values.clear();
    for (std::size_t i = 0; i < node->items.size(); ++i) {
      read_group(node->items[i], join(key, i), values.emplace_back());
    }
  }

  /// A nested struct with its own visit(), found by argument-dependent lookup.
  template <class T>
  void group(const char* key, T& value) {
    if (const YamlNode* node = find(key)) read_group(*node, join(key), value);
  }
  template <class T>
  void optional_group(const char* key, std::optional<T>& value) {
    optional(key, value, [&](T& v) { group(key, v); });
  }

  /// Without this key nothing works. Say it before or after the key itself.
  void require(const char* key);
  /// A condition that is not a range, on a key already read: `what` completes "KEY = VALUE: ...".
  void check(const char* key, bool ok, const std::string& what);

  void finish() const;

 private:
  const YamlNode* find(const char* key);
  const YamlNode* find_list(const char* key);
  [[nodiscard]] std::string join(const char* key) const;
  [[nodiscard]] std::string join(const char* key, std::size_t index) const;
  [[noreturn]] void fail(const YamlNode& node, const std::string& path, const std::string& what) const;
  [[noreturn]] void fail_choice(const YamlNode& node, const std::string& path,
                                const std::vector<std::string>& allowed) const;
  void expect(const YamlNode& node, const std::string& path, YamlNode::Kind kind, const char* what) const;
  [[nodiscard]] double read_number(const YamlNode& node, const std::string& path, double min, double max) const;
  [[nodiscard]] int64_t read_integer(const YamlNode& node, const std::string& path, int64_t min, int64_t max) const;
  [[nodiscard]] bool read_boolean(const YamlNode& node, const std::string& path) const;
  [[nodiscard]] std::string read_text(const YamlNode& node, const std::string& path) const;
  [[nodiscard]] std::vector<double> read_numbers(const YamlNode& node, const std::string& path, int rows, int columns,
                                                 double min, double max) const;

  template <class E>
  E read_choice(const YamlNode& node, const std::string& path, ChoiceNames<E> names) const {
    std::vector<std::string> allowed;
    for (const auto& [name, meaning] : names) {
      if (node.kind == YamlNode::Kind::kScalar && node.scalar == name) return meaning;
      allowed.emplace_back(name);
    }
    fail_choice(node, path, allowed);
  }
  template <int R, int C>
  void read_matrix(const YamlNode& node, const std::string& path, Eigen::Matrix<double, R, C>& value, double min,
                   double max) const {
    const std::vector<double> flat = read_numbers(node, path, R, C, min, max);
    for (int i = 0; i < R * C; ++i) value(i / C, i % C) = flat[static_cast<std::size_t>(i)];
  }
  template <class T>
  void read_group(const YamlNode& node, const std::string& path, T& value) const {
    expect(node, path, YamlNode::Kind::kMap, "a map");
    YamlReader reader(node, file_, path);
    visit(value, reader);
    reader.finish();
  }
  template <class T, class Read>
  void optional(const char* key, std::optional<T>& value, const Read& read) {
    if (find(key) == nullptr) return;
    if (!value) value.emplace();
    read(*value);
  }

  const YamlNode& map_;
  const std::string& file_;
  std::string path_;
  std::vector<std::string> known_;
};

}  // namespace roadfix
