#include "roadfix/import/picture_store.h"

#include <fmt/format.h>

#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace roadfix {
namespace {

struct Encoding {
  int channels;
  int conversion;  ///< to BGR or grey; -1: none
};

const std::map<std::string, Encoding>& encodings() {
  // OpenCV names a Bayer pattern by the second row's second and third pixel, ROS by the first row's first two.
  static const std::map<std::string, Encoding> known = {{"mono8", {1, -1}},
                                                        {"8UC1", {1, -1}},
                                                        {"bgr8", {3, -1}},
                                                        {"8UC3", {3, -1}},
                                                        {"rgb8", {3, cv::COLOR_RGB2BGR}},
                                                        {"bgra8", {4, cv::COLOR_BGRA2BGR}},
                                                        {"rgba8", {4, cv::COLOR_RGBA2BGR}},
                                                        {"bayer_rggb8", {1, cv::COLOR_BayerBG2BGR}},
                                                        {"bayer_bggr8", {1, cv::COLOR_BayerRG2BGR}},
                                                        {"bayer_gbrg8", {1, cv::COLOR_BayerGR2BGR}},
                                                        {"bayer_grbg8", {1, cv::COLOR_BayerGB2BGR}}};
  return known;
}

}  // namespace

bool is_known_encoding(const std::string& encoding) { return encodings().contains(encoding); }

std::vector<uint8_t> png_of(const RawPicture& picture) {
  const auto found = encodings().find(picture.encoding);
  if (found == encodings().end()) throw std::runtime_error("encoding '" + picture.encoding + "' is not known");
  const Encoding& encoding = found->second;
  constexpr int kMaxSide = 20000;
  const bool fits = picture.width_px > 0 && picture.height_px > 0 && picture.width_px <= kMaxSide &&
                    picture.height_px <= kMaxSide &&
                    picture.row_bytes >= int64_t{picture.width_px} * encoding.channels &&
                    static_cast<uint64_t>(picture.row_bytes) <= picture.size / static_cast<uint64_t>(picture.height_px);
  if (!fits) {
    throw std::runtime_error(fmt::format("{} x {} pixels of {} in rows of {} bytes do not fit into {} bytes",
                                         picture.width_px, picture.height_px, picture.encoding, picture.row_bytes,
                                         picture.size));
  }
  const cv::Mat raw(picture.height_px, picture.width_px, CV_8UC(encoding.channels), const_cast<uint8_t*>(picture.data),
                    static_cast<std::size_t>(picture.row_bytes));
  cv::Mat image = raw;
  if (encoding.conversion >= 0) cv::cvtColor(raw, image, encoding.conversion);
  std::vector<uint8_t> png;
  cv::imencode(".png", image, png, {cv::IMWRITE_PNG_COMPRESSION, 1});
  return png;
}

}  // namespace roadfix
