/// What a user reads when a file is wrong: always the file, the line where it is known, and what is wrong there.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace roadfix {

/// Thrown at start-up only; main() prints it and exits 2 (docs/STYLE.md, section 5).
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
  /// "FILE:LINE: MESSAGE"; without ":LINE" where line is 0.
  ConfigError(const std::string& file, int line, const std::string& message);
};

/// The whole file; ConfigError where it cannot be read or is longer than max_bytes.
std::string read_text_file(const std::filesystem::path& path, std::size_t max_bytes = std::size_t{1} << 24U);

/// Writes the whole file, its folders too, under its name only when it is complete (bus/log/output_place.h);
/// ConfigError where that fails or would replace a log.
void write_text_file(const std::filesystem::path& path, const std::string& text);

}  // namespace roadfix
