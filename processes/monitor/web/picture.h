/// A camera picture as a browser takes it.
#pragma once

#include <cstdint>
#include <optional>
#include <roadfix/image_t.hpp>
#include <string>
#include <vector>

namespace roadfix {

struct WebPicture {
  int64_t utime = 0;
  std::string mime;
  std::vector<uint8_t> bytes;
};

/// JPEG and PNG as they are, raw pictures as BMP; nothing for a picture whose size contradicts its data.
std::optional<WebPicture> web_picture(const image_t& image);

}  // namespace roadfix
