#include "roadfix/simulate/simulated_pictures.h"

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "simulation/random.h"

namespace roadfix {
namespace {

constexpr std::size_t kHeader = 200;  // bytes that damage leaves alone: a file without its header is no picture at all

/// A third of the files are cut off, the others have bytes changed.
void damage(std::vector<std::uint8_t>& file, std::uint64_t seed) {
  if (file.size() <= 2 * kHeader) return;
  RandomStream random(seed, 0);
  const std::size_t body = file.size() - kHeader;
  if (random.uniform() < 1.0 / 3.0) {
    file.resize(kHeader + random.bits() % body);
    return;
  }
  for (int i = 0; i < 24; ++i) file[kHeader + random.bits() % body] ^= static_cast<std::uint8_t>(random.bits() | 1U);
}

}  // namespace

std::vector<std::uint8_t> picture_file(const GrayImage& picture, const CameraConfig& config,
                                       const PictureEffects& effects) {
  const cv::Mat view(picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.pixels.data()));
  std::vector<std::uint8_t> file;
  const bool done = config.lossless ? cv::imencode(".png", view, file, {cv::IMWRITE_PNG_COMPRESSION, 3})
                                    : cv::imencode(".jpg", view, file, {cv::IMWRITE_JPEG_QUALITY, config.jpeg_quality});
  if (!done) throw std::runtime_error("simulate: OpenCV cannot write this picture");
  if (effects.corruption != 0) damage(file, effects.corruption);
  return file;
}

SimulatedPictures::SimulatedPictures(const SimulatedDrive& drive, Executor& executor,
                                     std::function<void(std::size_t)> progress)
    : drive_(drive), executor_(executor), progress_(std::move(progress)), film_(drive, executor) {}

const std::vector<Picture>& SimulatedPictures::pictures(CameraSide eye) const {
  return eye == CameraSide::kLeft ? drive_.pictures_left : drive_.pictures_right;
}

void SimulatedPictures::advance() {
  if (!film_.advance()) throw std::logic_error("simulate: a picture of an exposure that there is not");
  struct Job {
    CameraSide eye;
    std::size_t index;
    GrayImage pixels;
    image_t message;
  };
  std::vector<Job> jobs;
  for (const CameraSide eye : {CameraSide::kLeft, CameraSide::kRight}) {
    std::size_t& next = next_[static_cast<std::size_t>(eye)];
    for (; next < pictures(eye).size() && pictures(eye)[next].exposure == film_.taken(); ++next)
      jobs.push_back({eye, next, film_.picture(eye, pictures(eye)[next].effects), {}});
  }
  executor_.for_each(static_cast<int>(jobs.size()), [&](int k) {
    Job& job = jobs[static_cast<std::size_t>(k)];
    const Picture& picture = pictures(job.eye)[job.index];
    image_t& m = job.message;
    m.utime = picture.t_us;
    m.width_px = job.pixels.width;
    m.height_px = job.pixels.height;
    m.format = drive_.config.camera.lossless ? image_t::FORMAT_PNG : image_t::FORMAT_JPEG;
    m.exposure_s = film_.exposure().time_s;
    m.data = picture_file(job.pixels, drive_.config.camera, picture.effects);
    m.size_bytes = static_cast<std::int32_t>(m.data.size());
  });
  for (Job& job : jobs) ready_[static_cast<std::size_t>(job.eye)].emplace(job.index, std::move(job.message));
  progress_(film_.taken() + 1);
}

image_t SimulatedPictures::take(CameraSide eye, std::size_t index) {
  auto& ready = ready_[static_cast<std::size_t>(eye)];
  while (ready.find(index) == ready.end()) advance();
  return std::move(ready.extract(index).mapped());
}

}  // namespace roadfix
