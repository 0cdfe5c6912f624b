#include "features/saved_features.h"

namespace roadfix {

void save_features(std::span<const Feature> features, StateWriter& writer) {
  writer.put(static_cast<int64_t>(features.size()));
  for (const Feature& f : features) {
    writer.put(f.track);
    writer.put(f.pixel);
  }
}

std::vector<Feature> load_features(StateReader& reader) {
  std::vector<Feature> features;
  for (auto left = reader.get<int64_t>(); left > 0; --left) {
    Feature& f = features.emplace_back();
    reader.get(f.track);
    reader.get(f.pixel);
  }
  return features;
}

void save_image(const cv::Mat& gray, StateWriter& writer) {
  writer.put(gray.rows);
  writer.put(gray.cols);
  std::vector<uint8_t> pixels;
  pixels.reserve(gray.total());
  for (int row = 0; row < gray.rows; ++row) {
    pixels.insert(pixels.end(), gray.ptr<uint8_t>(row), gray.ptr<uint8_t>(row) + gray.cols);
  }
  writer.put(std::span<const uint8_t>(pixels));
}

cv::Mat load_image(StateReader& reader) {
  const int rows = reader.get<int>(), cols = reader.get<int>();
  std::vector<uint8_t> pixels;
  reader.get(pixels);
  if (rows < 0 || cols < 0 || pixels.size() != static_cast<size_t>(rows) * static_cast<size_t>(cols)) {
    throw std::runtime_error("state: a picture of the wrong size");
  }
  if (pixels.empty()) return {};
  return cv::Mat(rows, cols, CV_8UC1, pixels.data()).clone();
}

}  // namespace roadfix
