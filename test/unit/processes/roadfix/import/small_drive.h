/// A drive folder of a few rows with every file a drive folder may have, for tests to read and to break.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "support/temporary_folder.h"

namespace roadfix::test {

void write_file(const std::filesystem::path& path, const std::string& text);
void write_gzip(const std::filesystem::path& path, const std::string& text);
std::string read_file(const std::filesystem::path& path);

/// 3 s of IMU at 20 Hz, 12 fixes at 4 Hz, wheels, magnetometer, two pictures left and right,
/// reference with attitude.
void write_small_drive(const std::filesystem::path& folder);

inline constexpr int64_t kSmallDriveStart = 1700000000000000;  ///< utime of the first fix

/// A gray picture as PNG, without any image library.
std::string tiny_png(int width, int height);

}  // namespace roadfix::test
