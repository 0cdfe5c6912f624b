/// A file's bytes, mapped: only what is read comes into memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace roadfix {

class MappedFile {
 public:
  /// ConfigError where it cannot be read.
  explicit MappedFile(const std::filesystem::path& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  [[nodiscard]] std::span<const uint8_t> bytes() const { return bytes_; }

 private:
  std::span<const uint8_t> bytes_;
};

}  // namespace roadfix
