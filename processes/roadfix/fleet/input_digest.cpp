#include "roadfix/fleet/input_digest.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "config/config_error.h"
#include "stream/stream_hash.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

std::string hex(uint64_t value) { return fmt::format("{:016x}", value); }

/// The file itself, or all files below the folder, in the order of their names.
std::vector<fs::path> files_of(const fs::path& path) {
  if (!fs::is_directory(path)) return {path};
  std::vector<fs::path> files;
  const auto follow = fs::directory_options::follow_directory_symlink;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path, follow)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

void add_text(const std::string& text, StreamHash& hash) {
  hash.add(text.data(), text.size());
  hash.add("", 1);
}

void add_file(const fs::path& file, StreamHash& hash) {
  std::ifstream stream(file, std::ios::binary);
  std::array<char, std::size_t{1} << 16U> block;
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    hash.add(block.data(), static_cast<std::size_t>(stream.gcount()));
  }
  if (stream.bad() || !stream.eof()) throw ConfigError(file.string(), 0, "cannot be read");
}

}  // namespace

std::string text_digest(const std::string& text) {
  StreamHash hash;
  hash.add(text.data(), text.size());
  return hex(hash.value());
}

std::string path_digest(const fs::path& path) {
  StreamHash hash;
  for (const fs::path& file : files_of(path)) {
    if (file != path) {
      add_text(file.lexically_relative(path).string(), hash);
      add_text(std::to_string(fs::file_size(file)), hash);
    }
    add_file(file, hash);
  }
  return hex(hash.value());
}

std::string path_stamp(const fs::path& path) {
  StreamHash hash;
  for (const fs::path& file : files_of(path)) {
    struct stat status {};
    if (::stat(file.c_str(), &status) != 0) throw ConfigError(file.string(), 0, std::strerror(errno));
    add_text(file.lexically_relative(path).string(), hash);
    add_text(fmt::format("{} {}.{:09}", status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec), hash);
  }
  return hex(hash.value());
}

}  // namespace roadfix
