/// The text of every lcmtypes/roadfix_*.lcm file, embedded: the bus walks messages by it, the recorder puts it beside
/// its logs.
#pragma once

#include <string>
#include <vector>

namespace roadfix {

struct TypeText {
  std::string name;  ///< for example "imu_t"
  std::string text;  ///< the whole .lcm file
};

/// In the order of lcmtypes/CMakeLists.txt.
const std::vector<TypeText>& type_texts();

}  // namespace roadfix
