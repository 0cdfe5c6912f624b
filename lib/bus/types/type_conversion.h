/// Messages of types that were released once and have been replaced since, as messages of today's types. What replaces
/// what, and what stands in fields that the old type had not, is a table (released_rules()); docs/TYPES.md is the
/// policy behind it.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bus/types/schema.h"

namespace roadfix {

/// A field of the new type that the old one has not, or has under another name.
struct FieldRule {
  std::string field;
  std::string from;    ///< the old type's field; empty: `value`
  double value = 0.0;  ///< of every element; a string is empty
};

struct TypeRule {
  std::string version;  ///< the last that published it, for example "0.1"
  std::string from;     ///< type's name in that version
  std::string to;       ///< today's
  std::vector<FieldRule> fields = {};
};

/// The types of one released version.
struct ReleasedTypes {
  std::string version;
  std::vector<TypeText> texts;
};
/// Of lcmtypes/released, the oldest first.
const std::vector<ReleasedTypes>& released_types();
const std::vector<TypeRule>& released_rules();

class TypeConverter {
 public:
  /// Throws SchemaError where a field has no rule that it needs, or a rule names one that is not there: fields of
  /// one name and type are copied, numbers of one name and another type are converted, everything else needs a rule.
  TypeConverter(const std::vector<ReleasedTypes>& released, const Schema& current, const std::vector<TypeRule>& rules);
  /// Of what this program was built with.
  static const TypeConverter& built_in();

  enum class Result {
    kCurrent,    ///< one of today's types, or of nobody's: to be kept as it is
    kConverted,  ///< `out` holds it
    kBroken      ///< of an old type, but its bytes are no message of it
  };
  Result operator()(std::span<const uint8_t> message, std::vector<uint8_t>& out) const;

  /// "vo_features_t of 0.1", or nothing for what needs no conversion.
  [[nodiscard]] std::optional<std::string> old_name(int64_t fingerprint) const;

 private:
  struct Entry {
    TypeRule rule;
    const Schema* old = nullptr;
    MessageCheck check;
  };
  void require_complete(const Entry& entry) const;
  [[nodiscard]] const TypeRule* rule_of(const std::string& version, const std::string& type) const;
  class Writer;

  const Schema* current_;
  std::map<std::string, Schema> schemas_;  ///< by version
  std::map<int64_t, Entry> entries_;       ///< by the old fingerprint
};

}  // namespace roadfix
