#include "slam/place_index.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace roadfix {
namespace {

constexpr uint32_t kSeed = 20220911;
constexpr int kDescriptorBits = 256;

}  // namespace

PlaceIndex::PlaceIndex() : places_(size_t{kTables} << kBits) {
  std::mt19937 random(kSeed);
  for (auto& table : bits_) {
    for (int& bit : table) bit = static_cast<int>(random() % kDescriptorBits);
  }
}

PlaceIndex::Words PlaceIndex::words_of(const cv::Mat& descriptors) const {
  Words words;
  for (int row = 0; row < descriptors.rows; ++row) {
    const uint8_t* descriptor = descriptors.ptr<uint8_t>(row);
    for (uint32_t table = 0; table < kTables; ++table) {
      uint32_t word = 0;
      for (const int bit : bits_.at(table)) word = 2 * word + ((descriptor[bit / 8] >> (bit % 8)) & 1U);
      words.push_back((table << kBits) + word);
    }
  }
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  return words;
}

double PlaceIndex::weight(uint32_t word) const {
  const auto all = static_cast<double>(words_.size() + 1);
  return std::log(all / (1.0 + static_cast<double>(places_[word].size())));
}

std::vector<PlaceIndex::Candidate> PlaceIndex::look_up(const cv::Mat& descriptors, int64_t newest, size_t count) const {
  std::map<int64_t, double> shared;
  double own = 0.0;
  for (const uint32_t word : words_of(descriptors)) {
    const double w = weight(word);
    own += w;
    for (const int64_t place : places_[word]) {
      if (place <= newest) shared[place] += w;
    }
  }
  std::vector<Candidate> found;
  for (const auto& [place, sum] : shared) found.push_back({place, own > 0.0 ? sum / own : 0.0});
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  if (found.size() > count) found.resize(count);
  return found;
}

void PlaceIndex::add(int64_t place, const cv::Mat& descriptors) {
  Words words = words_of(descriptors);
  for (const uint32_t word : words) places_[word].push_back(place);
  words_.emplace(place, std::move(words));
}

void PlaceIndex::forget_before(int64_t place) {
  while (!words_.empty() && words_.begin()->first < place) {
    for (const uint32_t word : words_.begin()->second) {
      std::vector<int64_t>& list = places_[word];
      list.erase(list.begin());  // the oldest is first
    }
    words_.erase(words_.begin());
  }
}

}  // namespace roadfix
