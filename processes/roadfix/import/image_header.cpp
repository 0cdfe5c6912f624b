#include "roadfix/import/image_header.h"

#include <algorithm>
#include <array>
#include <string>

#include "config/config_error.h"

namespace roadfix {
namespace {

std::size_t big_endian(std::span<const uint8_t> bytes, std::size_t at, std::size_t count) {
  std::size_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = (value << 8U) | bytes[at + i];
  return value;
}

/// PNG specification, section 5.2 and 11.2.2: signature, then IHDR with width and height.
std::optional<ImageHeader> png_header(std::span<const uint8_t> bytes) {
  if (bytes.size() < 24) return std::nullopt;
  return ImageHeader{ImageHeader::Kind::kPng, static_cast<int>(big_endian(bytes, 16, 4)),
                     static_cast<int>(big_endian(bytes, 20, 4))};
}

/// ITU-T T.81, annex B: marker segments up to the frame header SOFn (0xC0 to 0xCF without DHT, JPG and DAC).
std::optional<ImageHeader> jpeg_header(std::span<const uint8_t> bytes) {
  std::size_t at = 2;
  while (at + 9 < bytes.size()) {
    if (bytes[at] != 0xFF) return std::nullopt;
    const unsigned marker = bytes[at + 1];
    if (marker == 0xFF) {  // fill byte
      ++at;
      continue;
    }
    const bool is_frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame) {
      return ImageHeader{ImageHeader::Kind::kJpeg, static_cast<int>(big_endian(bytes, at + 7, 2)),
                         static_cast<int>(big_endian(bytes, at + 5, 2))};
    }
    at += 2 + big_endian(bytes, at + 2, 2);
  }
  return std::nullopt;
}

/// Chunk by chunk: length, type, data, checksum (section 5.3).
bool has_png_end(std::span<const uint8_t> bytes) {
  constexpr std::array<uint8_t, 4> kEnd = {'I', 'E', 'N', 'D'};
  std::size_t at = 8;
  while (at + 12 <= bytes.size()) {
    const std::size_t next = at + 12 + big_endian(bytes, at, 4);
    if (std::equal(kEnd.begin(), kEnd.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at) + 4))
      return next <= bytes.size();
    at = next;
  }
  return false;
}

/// Segment by segment (annex B): a thumbnail inside one has an end of its own. After a scan's header come coded data,
/// in which a marker is 0xFF before anything but 0, a fill byte or a restart marker (0xD0 to 0xD7).
bool has_jpeg_end(std::span<const uint8_t> bytes) {
  constexpr unsigned kEnd = 0xD9;
  std::size_t at = 2;
  while (at + 1 < bytes.size()) {
    const unsigned marker = bytes[at + 1];
    if (bytes[at] != 0xFF || marker == 0xFF || marker == 0 || (marker >= 0xD0 && marker <= 0xD7)) {
      ++at;
      continue;
    }
    if (marker == kEnd) return true;
    if (at + 4 > bytes.size()) return false;
    at += 2 + big_endian(bytes, at + 2, 2);
  }
  return false;
}

}  // namespace

ImageHeader read_picture_header(const std::filesystem::path& path) {
  const std::string bytes = read_text_file(path, std::size_t{1} << 27U);
  const auto header = read_image_header(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
  if (!header) throw ConfigError(path.string(), 0, "is no picture");
  return *header;
}

bool has_image_end(std::span<const uint8_t> bytes, ImageHeader::Kind kind) {
  return kind == ImageHeader::Kind::kPng ? has_png_end(bytes) : has_jpeg_end(bytes);
}

std::optional<ImageHeader> read_image_header(std::span<const uint8_t> bytes) {
  constexpr std::array<uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  constexpr int kMaxPixels = 65535;
  std::optional<ImageHeader> header;
  if (bytes.size() > kPngSignature.size() && std::equal(kPngSignature.begin(), kPngSignature.end(), bytes.begin())) {
    header = png_header(bytes);
  } else if (bytes.size() > 2 && bytes[0] == 0xFF && bytes[1] == 0xD8) {
    header = jpeg_header(bytes);
  }
  const auto sane = [](int pixels) { return pixels > 0 && pixels <= kMaxPixels; };
  if (header && !(sane(header->width_px) && sane(header->height_px))) return std::nullopt;
  return header;
}

}  // namespace roadfix
