/// The subset of YAML that configurations use, as a plain tree: one document of maps, lists and scalars, each with its
/// line. Anchors, aliases, tags, several documents and duplicate keys are errors.
#pragma once

#include <string>
#include <vector>

namespace roadfix {

struct YamlNode {
  enum class Kind { kNull, kScalar, kList, kMap };

  Kind kind = Kind::kNull;
  int line = 0;         ///< of its first character, counted from 1
  bool quoted = false;  ///< a quoted scalar is text, never a number
  std::string scalar;
  std::vector<std::string> keys;  ///< of a map, in file order
  std::vector<YamlNode> items;    ///< of a list, or the values of a map

  /// The value of a key of a map, or nothing.
  [[nodiscard]] const YamlNode* find(const std::string& key) const;
};

/// "a map", "a list", the scalar itself, for messages.
std::string describe(const YamlNode& node);

/// The tree of TEXT; `file` names it in errors (ConfigError). An empty text is an empty map.
YamlNode parse_yaml_tree(const std::string& text, const std::string& file);

}  // namespace roadfix
