#include "bus/run/build_id.h"

namespace roadfix {

// Weak: the generated build_id of a program takes its place.
__attribute__((weak)) const char* build_id_text() { return "test"; }

std::string version_text(const std::string& name) {
  return name + " " + ROADFIX_VERSION + " (build " + build_id_text() + ")";
}

}  // namespace roadfix
