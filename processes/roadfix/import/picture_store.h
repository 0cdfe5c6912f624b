/// Pictures that lie in no file of their own: in a bag, in a film.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace roadfix {

class PictureStore {
 public:
  virtual ~PictureStore() = default;
  /// JPEG or PNG; ConfigError where it is damaged. One behind the other is cheap.
  virtual std::vector<uint8_t> read(std::size_t index) = 0;
};

/// A raw picture as PNG, which loses nothing. `encoding`: a ROS sensor_msgs/Image's; empty where it is none that a
/// camera of ours can have (mono8, bgr8, rgb8, bgra8, rgba8, 8UC1, 8UC3 and Bayer patterns of 8 bits).
bool is_known_encoding(const std::string& encoding);

struct RawPicture {
  std::string encoding;
  int width_px = 0;
  int height_px = 0;
  int64_t row_bytes = 0;
  const uint8_t* data = nullptr;
  std::size_t size = 0;
};
/// std::runtime_error where the sizes do not fit.
std::vector<uint8_t> png_of(const RawPicture& picture);

}  // namespace roadfix
