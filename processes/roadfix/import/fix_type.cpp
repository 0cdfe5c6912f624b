#include "roadfix/import/fix_type.h"

namespace roadfix {

const std::vector<std::string>& fix_type_names() {
  static const std::vector<std::string> names = {"none",      "single",    "differential",
                                                 "rtk_float", "rtk_fixed", "dead_reckoning"};  // in FixType's order
  return names;
}

std::optional<FixType> fix_type_from_name(std::string_view name) {
  for (std::size_t i = 0; i < fix_type_names().size(); ++i) {
    if (fix_type_names()[i] == name) return static_cast<FixType>(i);
  }
  return std::nullopt;
}

}  // namespace roadfix
