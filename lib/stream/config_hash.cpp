#include "stream/config_hash.h"

#include <span>

#include "stream/digest.h"

namespace roadfix {

int64_t config_hash(const std::string& config_yaml, const std::string& calibration_yaml) {
  Digest digest;
  for (const std::string* text : {&config_yaml, &calibration_yaml}) {
    digest.add(static_cast<int64_t>(text->size()));
    digest.add(std::span(reinterpret_cast<const uint8_t*>(text->data()), text->size()));
  }
  return static_cast<int64_t>(digest.value());
}

}  // namespace roadfix
