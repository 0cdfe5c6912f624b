/// Reads the text of .lcm files: what lcm-gen reads, as far as our types need it (no enums, no sizes by constants).
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace roadfix {

/// A type text that cannot be read; names the type and the word.
struct SchemaError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct SchemaDim {
  std::string text;   ///< as written: a number, or the name of an earlier integer field
  int64_t fixed = 0;  ///< where it is a number
  int field = -1;     ///< index of the earlier field otherwise
};

struct SchemaField {
  std::string type;  ///< without package
  std::string name;
  std::vector<SchemaDim> dims;
};

struct SchemaType {
  std::string name;
  std::vector<SchemaField> fields;
};

/// Size of a primitive of fixed size; 0 for strings and structs.
int primitive_bytes(const std::string& type);
bool is_primitive(const std::string& type);  ///< strings included

/// The one struct in `text`. `where` names it in errors.
SchemaType parse_lcm_type(const std::string& where, const std::string& text);

}  // namespace roadfix
