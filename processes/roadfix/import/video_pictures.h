/// The pictures of a video file, decoded by OpenCV one after the other and packed as JPEG.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "roadfix/import/picture_store.h"

namespace roadfix {

/// How many pictures the video gives and their size, by decoding all of it; nothing where OpenCV cannot open it.
struct VideoFacts {
  std::size_t pictures = 0;
  int width_px = 0;
  int height_px = 0;
};
std::optional<VideoFacts> read_video_facts(const std::filesystem::path& path);

/// Its pictures; reading one before the last one begins the video again.
std::shared_ptr<PictureStore> open_video(const std::filesystem::path& path);

}  // namespace roadfix
