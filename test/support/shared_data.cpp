#include "support/shared_data.h"

#include <iostream>

namespace roadfix::test {

std::filesystem::path source_path(const std::string& relative) {
  return std::filesystem::path(ROADFIX_SOURCE_DIR) / relative;
}

std::optional<std::filesystem::path> shared_path(const std::string& relative) {
  const std::filesystem::path path = source_path("../shared") / relative;
  if (std::filesystem::exists(path)) return path;
  std::cout << "skipped: ../shared/" << relative << " is not here\n";
  return std::nullopt;
}

}  // namespace roadfix::test
