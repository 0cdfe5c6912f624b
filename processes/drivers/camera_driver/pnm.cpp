#include "drivers/camera_driver/pnm.h"

#include <fmt/format.h>

#include <charconv>
#include <opencv2/imgproc.hpp>
#include <string_view>

namespace roadfix {

namespace {
constexpr int kMaxSide_px = 16384;
}

std::vector<uint8_t> write_pnm(const cv::Mat& picture) {
  const bool gray = picture.channels() == 1;
  cv::Mat samples;
  if (gray)
    samples = picture.isContinuous() ? picture : picture.clone();
  else
    cv::cvtColor(picture, samples, cv::COLOR_BGR2RGB);
  const std::string head = fmt::format("P{}\n{} {}\n255\n", gray ? 5 : 6, picture.cols, picture.rows);
  std::vector<uint8_t> bytes(head.begin(), head.end());
  bytes.insert(bytes.end(), samples.data, samples.data + samples.total() * samples.elemSize());
  return bytes;
}

cv::Mat read_pnm(std::span<const uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.starts_with("P5\n") && !text.starts_with("P6\n")) return {};
  const int channels = text[1] == '5' ? 1 : 3;
  int sizes[3] = {};  // width, height, largest sample
  const char* at = text.data() + 3;
  const char* const end = text.data() + text.size();
  for (int& size : sizes) {
    const auto parsed = std::from_chars(at, end, size);
    if (parsed.ec != std::errc() || parsed.ptr == end || size <= 0 || size > kMaxSide_px) return {};
    at = parsed.ptr + 1;  // the one blank behind a number
  }
  const auto wanted = static_cast<std::size_t>(sizes[0]) * static_cast<std::size_t>(sizes[1] * channels);
  if (sizes[2] != 255 || static_cast<std::size_t>(end - at) != wanted) return {};
  const cv::Mat view(sizes[1], sizes[0], channels == 1 ? CV_8UC1 : CV_8UC3, const_cast<char*>(at));
  cv::Mat picture;
  if (channels == 1)
    picture = view.clone();
  else
    cv::cvtColor(view, picture, cv::COLOR_RGB2BGR);
  return picture;
}

std::optional<cv::Size> read_jpeg_size(std::span<const uint8_t> b) {
  const auto number = [&](std::size_t i) { return (b[i] << 8) | b[i + 1]; };
  for (std::size_t i = 2; i + 9 < b.size();) {
    if (b[i] != 0xFF) return std::nullopt;
    const uint8_t marker = b[i + 1];
    if (marker == 0xFF) {  // fill
      ++i;
      continue;
    }
    const bool start_of_frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (start_of_frame) return cv::Size(number(i + 7), number(i + 5));
    const int length = number(i + 2);
    if (length < 2) return std::nullopt;
    i += 2 + static_cast<std::size_t>(length);
  }
  return std::nullopt;
}

}  // namespace roadfix
