// Any bytes as a message of an old log: what is converted is a message of a type of today.
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "bus/types/field_difference.h"
#include "bus/types/type_conversion.h"
#include "roadfix/vo_features2_t.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  using namespace roadfix;
  static const MessageCheck kCheck = Schema::built_in().check_of(vo_features2_t::getTypeName());
  std::vector<uint8_t> out;
  const auto result = TypeConverter::built_in()(std::span<const uint8_t>(data, size), out);
  if (result == TypeConverter::Result::kConverted && kCheck(out) != CheckResult::kOk) std::abort();
  return 0;
}
