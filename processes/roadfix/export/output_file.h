/// Where an export goes: a file that appears under its name only when it is whole, or standard output for "-".
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "bus/log/output_place.h"

namespace roadfix {

class OutputFile {
 public:
  /// std::runtime_error where it cannot be created.
  explicit OutputFile(const std::filesystem::path& path);
  ~OutputFile();  ///< without commit() nothing stays
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// std::runtime_error for a full disk and for a reader that has gone.
  void write(std::span<const uint8_t> bytes);
  void commit();

  [[nodiscard]] bool is_standard_output() const { return standard_output_; }

 private:
  void hand_out(std::span<const uint8_t> bytes) const;
  [[noreturn]] void fail(const char* what) const;

  bool standard_output_;
  OutputPlace place_;
  int fd_ = -1;
  std::vector<uint8_t> buffer_;
};

}  // namespace roadfix
