/// Where the drives of ../shared are, for tests that need them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace roadfix::test {

/// A path inside this repository, for example source_path("logs/demo.lcm").
std::filesystem::path source_path(const std::string& relative);

/// The path of ../shared/RELATIVE; where it is missing, prints "skipped: ..." (which CTest reports as skipped) and
/// returns nothing:
///   const auto drive = shared_path("data/car_0708");
///   if (!drive) return;
std::optional<std::filesystem::path> shared_path(const std::string& relative);

}  // namespace roadfix::test
