/// Pictures as bytes that explain themselves: binary PNM, and the size that a JPEG claims.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

namespace roadfix {

/// P5 of a grey picture, P6 of a blue-green-red one, 8 bits a sample (Netpbm, "pgm" and "ppm" file formats).
std::vector<uint8_t> write_pnm(const cv::Mat& picture);

/// Empty where the bytes are no such picture.
cv::Mat read_pnm(std::span<const uint8_t> bytes);

/// From the frame header (ITU-T T.81, B.2.2); absent where there is none.
std::optional<cv::Size> read_jpeg_size(std::span<const uint8_t> bytes);

}  // namespace roadfix
