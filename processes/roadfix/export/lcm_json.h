/// Our messages as JSON, and the JSON schema that says so. Every field keeps its name. Byte arrays are base64; 64-bit
/// hashes (digest, config_hash) are decimal text, because readers in JavaScript keep 53 bits; a number that JSON has
/// not (NaN, infinity) is null.
#pragma once

#include <string>

#include "bus/types/schema.h"

namespace roadfix {

/// One type, compiled: writing a message looks up no name.
class LcmJson {
 public:
  /// Without the byte arrays where `leave_out_bytes` is set: they are exported elsewhere.
  LcmJson(const Schema& schema, const std::string& type, bool leave_out_bytes);

  /// The JSON schema, as MCAP's encoding "jsonschema" wants it.
  [[nodiscard]] const std::string& schema_text() const { return schema_text_; }

  /// Appends one object. `bytes` passed the type's check.
  void write(std::span<const uint8_t> bytes, std::string& out) const;

 private:
  enum class Kind { kInteger, kHash, kBoolean, kFloat, kDouble, kText, kBytes, kStruct };
  struct Step {
    std::string key;  ///< with quotes and colon
    Kind kind = Kind::kInteger;
    int size = 0;                                ///< bytes of one number
    std::vector<std::pair<int, int64_t>> sizes;  ///< by count (index) or, with -1, fixed
    int count = -1;                              ///< which count this field is
    bool left_out = false;
    std::size_t program = 0;
  };
  struct Program {
    std::vector<Step> steps;
    int counts = 0;
  };
  struct Cursor;

  std::size_t compile(const Schema& schema, const SchemaType& type, bool leave_out_bytes, std::string& text);
  void write_struct(const Program& program, Cursor& cursor) const;
  void write_array(const Step& step, const std::vector<int64_t>& sizes, std::size_t level, Cursor& cursor) const;
  void write_one(const Step& step, Cursor& cursor) const;

  std::vector<Program> programs_;
  std::size_t main_ = 0;
  std::string schema_text_;
};

}  // namespace roadfix
