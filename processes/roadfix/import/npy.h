/// Arrays of numbers as numpy.save writes them (NumPy Enhancement Proposal 1, format 1.0 to 3.0): little-endian float32,
/// float64 and integers, of one or two dimensions.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace roadfix {

struct NpyArray {
  std::string file;
  std::size_t rows = 0;
  std::size_t columns = 1;
  std::vector<double> numbers;  ///< by rows, whatever the file's order

  [[nodiscard]] double at(std::size_t row, std::size_t column = 0) const { return numbers[row * columns + column]; }
};

/// ConfigError with file and offset where it is no such array, is cut short, or is longer than its shape says.
NpyArray parse_npy(std::span<const uint8_t> bytes, const std::string& file);
/// The same, of `columns` columns.
NpyArray read_npy(const std::filesystem::path& path, std::size_t columns);

}  // namespace roadfix
