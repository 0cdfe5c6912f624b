#include "roadfix/import/video_pictures.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "config/config_error.h"

namespace roadfix {
namespace {

class VideoPictures : public PictureStore {
 public:
  explicit VideoPictures(std::filesystem::path path) : path_(std::move(path)) {}

  std::vector<uint8_t> read(std::size_t index) override {
    if (!capture_.isOpened() || index < next_) {
      if (!capture_.open(path_.string(), cv::CAP_FFMPEG)) throw ConfigError(path_.string(), 0, "cannot be decoded");
      next_ = 0;
    }
    cv::Mat picture;
    for (; next_ <= index; ++next_) {
      if (!capture_.grab()) throw ConfigError(path_.string(), 0, fmt::format("has no picture {}", next_ + 1));
    }
    capture_.retrieve(picture);
    std::vector<uint8_t> jpeg;
    constexpr int kQuality = 95;  // the video has lost more than this does
    cv::imencode(".jpg", picture, jpeg, {cv::IMWRITE_JPEG_QUALITY, kQuality});
    return jpeg;
  }

 private:
  std::filesystem::path path_;
  cv::VideoCapture capture_;
  std::size_t next_ = 0;
};

}  // namespace

std::optional<VideoFacts> read_video_facts(const std::filesystem::path& path) {
  cv::VideoCapture capture;
  if (!capture.open(path.string(), cv::CAP_FFMPEG)) return std::nullopt;
  VideoFacts facts;
  facts.width_px = static_cast<int>(capture.get(cv::CAP_PROP_FRAME_WIDTH));
  facts.height_px = static_cast<int>(capture.get(cv::CAP_PROP_FRAME_HEIGHT));
  while (capture.grab()) ++facts.pictures;
  if (facts.pictures == 0) return std::nullopt;
  return facts;
}

std::shared_ptr<PictureStore> open_video(const std::filesystem::path& path) {
  return std::make_shared<VideoPictures>(path);
}

}  // namespace roadfix
