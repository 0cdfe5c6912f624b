/// Place recognition: binary descriptors as visual words, with an inverted index.
///
/// A word is the value of a fixed, seeded selection of descriptor bits (bit sampling, Indyk and Motwani 1998): similar
/// descriptors share a word in some of several selections. The vocabulary needs no training and no file; inverse
/// document frequencies (Sivic and Zisserman 2003) are counted online.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace roadfix {

class PlaceIndex {
 public:
  PlaceIndex();

  struct Candidate {
    int64_t place = 0;
    double score = 0.0;  ///< 1: the same words
  };
  /// The most similar places, best first, up to and including `newest`.
  [[nodiscard]] std::vector<Candidate> look_up(const cv::Mat& descriptors, int64_t newest, size_t count) const;

  /// Places come in ascending order.
  void add(int64_t place, const cv::Mat& descriptors);
  /// Removes the places before this one.
  void forget_before(int64_t place);

  static constexpr int kTables = 8;
  static constexpr int kBits = 13;  ///< of 256, per word

 private:
  using Words = std::vector<uint32_t>;  ///< ascending
  [[nodiscard]] Words words_of(const cv::Mat& descriptors) const;
  [[nodiscard]] double weight(uint32_t word) const;

  std::array<std::array<int, kBits>, kTables> bits_{};
  std::vector<std::vector<int64_t>> places_;  ///< by word
  std::map<int64_t, Words> words_;            ///< by place
};

}  // namespace roadfix
