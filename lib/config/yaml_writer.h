/// The visitor that writes a configuration struct as YAML; what YamlReader reads back gives the same bits. Users call
/// config.h.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/yaml_reader.h"

namespace roadfix {

/// The methods of YamlReader; ranges and conditions are the reader's business. An optional without a value is left out.
class YamlWriter {
 public:
  enum class Alternatives { kLeftOut, kNamed };
  /// kNamed: behind a choice stands, as a comment, what else it could be.
  explicit YamlWriter(Alternatives alternatives = Alternatives::kLeftOut) : alternatives_(alternatives) {}

  void number(const char* key, const double& value, double, double);
  template <std::integral T>
  void integer(const char* key, const T& value, int64_t, int64_t) {
    line(key, std::to_string(value));
  }
  void boolean(const char* key, const bool& value);
  void text(const char* key, const std::string& value);
  template <class E>
  void choice(const char* key, const E& value, ChoiceNames<E> names) {
    line(key, name_of<E>(value, names) + alternatives_text<E>({value}, names));
  }
  template <int R, int C>
  void vector(const char* key, const Eigen::Matrix<double, R, C>& value, double, double) {
    std::vector<double> flat;
    for (int i = 0; i < R * C; ++i) flat.push_back(value(i / C, i % C));
    line(key, matrix_text(flat, C));
  }

  void optional_number(const char* key, const std::optional<double>& value, double min, double max) {
    if (value) number(key, *value, min, max);
  }
  template <std::integral T>
  void optional_integer(const char* key, const std::optional<T>& value, int64_t min, int64_t max) {
    if (value) integer(key, *value, min, max);
  }
  void optional_boolean(const char* key, const std::optional<bool>& value) {
    if (value) boolean(key, *value);
  }
  void optional_text(const char* key, const std::optional<std::string>& value) {
    if (value) text(key, *value);
  }
  template <class E>
  void optional_choice(const char* key, const std::optional<E>& value, ChoiceNames<E> names) {
    if (value) choice(key, *value, names);
  }
  template <int R, int C>
  void optional_vector(const char* key, const std::optional<Eigen::Matrix<double, R, C>>& value, double min,
                       double max) {
    if (value) vector(key, *value, min, max);
  }

  void numbers(const char* key, const std::vector<double>& values, double, double);
  void integers(const char* key, const std::vector<int64_t>& values, int64_t, int64_t);
  void texts(const char* key, const std::vector<std::string>& values);
  template <class E>
  void choices(const char* key, const std::vector<E>& values, ChoiceNames<E> names) {
    std::vector<std::string> texts;
    for (const E& value : values) texts.push_back(name_of<E>(value, names));
    list_line(key, texts, alternatives_text<E>(values, names));
  }
  template <class T>
  void groups(const char* key, std::vector<T>& values) {
    std::vector<std::vector<std::string>> blocks;
    for (T& value : values) blocks.push_back(lines_of(value));
    block_list(key, blocks);
  }
  template <class T>
  void group(const char* key, T& value) {
    block(key, lines_of(value));
  }
  template <class T>
  void optional_group(const char* key, std::optional<T>& value) {
    if (value) group(key, *value);
  }

  void require(const char*) {}
  void check(const char*, bool, const std::string&) {}

  /// All lines so far, each ended; "{}" where there is none.
  [[nodiscard]] std::string text() const;

 private:
  template <class E>
  static std::string name_of(const E& value, ChoiceNames<E> names) {
    for (const auto& [name, meaning] : names) {
      if (meaning == value) return name;
    }
    return "?";  // a value without a name: the reader refuses it with the list of names
  }
  template <class E>
  [[nodiscard]] std::string alternatives_text(const std::vector<E>& chosen, ChoiceNames<E> names) const {
    if (alternatives_ == Alternatives::kLeftOut) return "";
    std::string others;
    for (const auto& [name, meaning] : names) {
      if (std::find(chosen.begin(), chosen.end(), meaning) != chosen.end()) continue;
      others += (others.empty() ? "  # or: " : ", ") + std::string(name);
    }
    return others;
  }
  template <class T>
  std::vector<std::string> lines_of(T& value) {
    YamlWriter writer(alternatives_);
    visit(value, writer);
    return std::move(writer.lines_);
  }
  static std::string matrix_text(const std::vector<double>& flat, int columns);
  void line(const char* key, const std::string& value);
  void list_line(const char* key, const std::vector<std::string>& values, const std::string& comment = "");
  void block(const char* key, const std::vector<std::string>& lines);
  void block_list(const char* key, const std::vector<std::vector<std::string>>& blocks);

  Alternatives alternatives_;
  std::vector<std::string> lines_;
};

/// A text as one YAML scalar: plain where that is safe, otherwise in double quotes.
std::string yaml_scalar(const std::string& text);

}  // namespace roadfix
