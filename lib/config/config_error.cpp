#include "config/config_error.h"

#include <fmt/format.h>

#include <fstream>

namespace roadfix {

ConfigError::ConfigError(const std::string& file, int line, const std::string& message)
    : std::runtime_error(line > 0 ? fmt::format("{}:{}: {}", file, line, message)
                                  : fmt::format("{}: {}", file, message)) {}

std::string read_text_file(const std::filesystem::path& path, std::size_t max_bytes) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw ConfigError(path.string(), 0, "no such file");
  if (!std::filesystem::is_regular_file(path, error)) throw ConfigError(path.string(), 0, "is not a file");
  const auto size = std::filesystem::file_size(path, error);
  if (error) throw ConfigError(path.string(), 0, "cannot be read: " + error.message());
  if (size > max_bytes) {
    throw ConfigError(path.string(), 0, fmt::format("has {} bytes, more than the {} allowed", size, max_bytes));
  }
  std::ifstream stream(path, std::ios::binary);
  std::string text(size, '\0');
  if (!stream.read(text.data(), static_cast<std::streamsize>(size))) {
    throw ConfigError(path.string(), 0, "cannot be read");
  }
  return text;
}

void write_text_file(const std::filesystem::path& path, const std::string& text) {
  std::error_code error;
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), error);
  const std::filesystem::path partial = path.string() + ".part";
  {
    std::ofstream stream(partial, std::ios::binary);
    stream << text;
    stream.close();
    if (!stream) throw ConfigError(path.string(), 0, "cannot be written");
  }
  std::filesystem::rename(partial, path, error);
  if (error) throw ConfigError(path.string(), 0, "cannot be written: " + error.message());
}

}  // namespace roadfix
