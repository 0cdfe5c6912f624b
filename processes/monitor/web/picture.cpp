#include "monitor/web/picture.h"

namespace roadfix {

namespace {

constexpr std::size_t kHead = 54, kPalette = std::size_t{4} * 256;

void put(std::vector<uint8_t>& out, std::size_t at, uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out[at + static_cast<std::size_t>(i)] = static_cast<uint8_t>(value >> (8 * i));
}

/// BITMAPFILEHEADER and BITMAPINFOHEADER: rows from the top (negative height), each filled up to 4 bytes.
std::vector<uint8_t> bmp(const image_t& image, std::size_t channels) {
  const auto width = static_cast<std::size_t>(image.width_px), height = static_cast<std::size_t>(image.height_px);
  const std::size_t stride = (width * channels + 3) / 4 * 4;
  const std::size_t start = kHead + (channels == 1 ? kPalette : 0);
  std::vector<uint8_t> out(start + stride * height, 0);
  out[0] = 'B';
  out[1] = 'M';
  put(out, 2, static_cast<uint32_t>(out.size()), 4);
  put(out, 10, static_cast<uint32_t>(start), 4);
  put(out, 14, 40, 4);
  put(out, 18, static_cast<uint32_t>(width), 4);
  put(out, 22, static_cast<uint32_t>(-image.height_px), 4);
  put(out, 26, 1, 2);
  put(out, 28, static_cast<uint32_t>(8 * channels), 2);
  for (std::size_t i = 0; channels == 1 && i < 256; ++i)
    put(out, kHead + 4 * i, static_cast<uint32_t>(i) * 0x010101U, 4);
  for (std::size_t row = 0; row < height; ++row) {
    const auto from = image.data.begin() + static_cast<std::ptrdiff_t>(row * width * channels);
    std::copy(from, from + static_cast<std::ptrdiff_t>(width * channels),
              out.begin() + static_cast<std::ptrdiff_t>(start + row * stride));
  }
  return out;
}

}  // namespace

std::optional<WebPicture> web_picture(const image_t& image) {
  constexpr int32_t kMaxSide = 16384;
  if (image.format == image_t::FORMAT_JPEG || image.format == image_t::FORMAT_PNG) {
    return WebPicture{image.utime, image.format == image_t::FORMAT_JPEG ? "image/jpeg" : "image/png", image.data};
  }
  if (image.format != image_t::FORMAT_GRAY8 && image.format != image_t::FORMAT_BGR8) return std::nullopt;
  const std::size_t channels = image.format == image_t::FORMAT_GRAY8 ? 1 : 3;
  if (image.width_px <= 0 || image.height_px <= 0 || image.width_px > kMaxSide || image.height_px > kMaxSide ||
      image.data.size() !=
          static_cast<std::size_t>(image.width_px) * static_cast<std::size_t>(image.height_px) * channels) {
    return std::nullopt;
  }
  return WebPicture{image.utime, "image/bmp", bmp(image, channels)};
}

}  // namespace roadfix
