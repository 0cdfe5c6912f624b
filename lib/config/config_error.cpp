#include "config/config_error.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "bus/log/log_file.h"
#include "bus/log/output_place.h"

namespace roadfix {

namespace {

bool is_log(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;
  uint32_t magic = 0;
  std::ifstream stream(path, std::ios::binary);
  for (int i = 0; i < 4; ++i) magic = (magic << 8U) | static_cast<uint32_t>(stream.get() & 0xFF);
  return stream.good() && magic == kLogMagic;
}

}  // namespace

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
  if (error) throw ConfigError(path.string(), 0, "its folder cannot be made: " + error.message());
  const OutputPlace place = output_place(path);
  if (is_log(place.path)) throw ConfigError(path.string(), 0, "is a log; it would be replaced");
  errno = 0;
  std::ofstream stream(place.written, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) {
    const std::string why = std::strerror(errno);
    if (place.written != place.path) std::filesystem::remove(place.written, error);
    throw ConfigError(path.string(), 0, "cannot be written: " + why);
  }
  if (place.written == place.path) return;
  std::filesystem::rename(place.written, place.path, error);
  if (error) throw ConfigError(path.string(), 0, "cannot be written: " + error.message());
}

}  // namespace roadfix
