/// Size and kind of a packed picture from its first bytes, and whether its last are there, without decoding it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

namespace roadfix {

struct ImageHeader {
  enum class Kind { kJpeg, kPng };
  Kind kind = Kind::kJpeg;
  int width_px = 0;
  int height_px = 0;
};

/// Nothing where the bytes are neither JPEG nor PNG, or end before the size.
std::optional<ImageHeader> read_image_header(std::span<const uint8_t> bytes);

/// The same of a file; ConfigError where it is missing, or no picture.
ImageHeader read_picture_header(const std::filesystem::path& path);

/// Whether the picture has its end: PNG's IEND, JPEG's EOI. What is cut off before that decodes to grey.
bool has_image_end(std::span<const uint8_t> bytes, ImageHeader::Kind kind);

}  // namespace roadfix
