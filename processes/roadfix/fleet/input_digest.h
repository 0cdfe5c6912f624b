/// Digests of what a task computes from, 16 hexadecimal digits of XXH64 each. A stamp is cheap and only says that
/// nothing was touched: names, sizes and times. Where stamps differ the digests decide.
#pragma once

#include <filesystem>
#include <string>

namespace roadfix {

std::string text_digest(const std::string& text);

/// Of a file's bytes, or of the names and bytes of all files below a folder. ConfigError where one cannot be read.
std::string path_digest(const std::filesystem::path& path);
std::string path_stamp(const std::filesystem::path& path);

}  // namespace roadfix
