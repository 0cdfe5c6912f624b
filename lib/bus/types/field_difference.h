/// Names the first field in which two messages of one type differ.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bus/types/schema.h"

namespace roadfix {

struct FieldValue {
  std::string path;   ///< for example "provenance.last_seq[2]"
  std::string value;  ///< as text; floating point with every digit that counts
};

/// Every primitive of a message that passed its check, in order. Byte arrays count as one value.
std::vector<FieldValue> list_fields(const Schema& schema, const std::string& type, std::span<const uint8_t> bytes);

/// "position_m[1]: 3.25 and 3.5", or nothing where all fields agree. Both must have passed the type's check. Fields
/// whose path begins with `skipped` do not count, where that is not empty.
std::optional<std::string> first_difference(const Schema& schema, const std::string& type, std::span<const uint8_t> a,
                                            std::span<const uint8_t> b, const std::string& skipped = {});

}  // namespace roadfix
