/// Distance travelled between two times, from speeds that arrive with a delay: the source of the monocular scale.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace roadfix {

enum class SpeedSource : int8_t { kWheels = 0, kIns = 1 };

struct SpeedSample {
  int64_t t_us = 0;
  SpeedSource source = SpeedSource::kWheels;
  double speed = 0.0;      ///< m/s, negative in reverse where directed, else a magnitude
  double sigma = 0.0;      ///< m/s, noise of one sample
  double scale_std = 0.0;  ///< relative, common to all samples of the source
  bool directed = true;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.source, self.speed, self.sigma, self.scale_std, self.directed);
  }
};

/// Displacement by unmeasured acceleration within `dt_s`, m.
[[nodiscard]] double unmeasured_displacement(double dt_s);

constexpr double kMinDistanceSigma = 0.005;  ///< m; lower bound of any speed sensor's error between two images

struct TravelledDistance {
  double distance = 0.0;  ///< m, between the two positions
  double sigma = 0.0;     ///< m, without the common scale error
  double scale_std = 0.0;
  bool backwards = false;
};

/// Speeds of one source. Linear interpolation between samples; constant extrapolation outside, with a sigma for
/// unmeasured acceleration.
class DistanceHistory {
 public:
  /// Samples in time order; an older one is ignored.
  void add(const SpeedSample& sample);

  /// From `begin_us` to `end_us`; no value where no sample lies within `kExtrapolation_us` of both.
  [[nodiscard]] std::optional<TravelledDistance> between(int64_t begin_us, int64_t end_us) const;

  struct Span {
    int64_t first_us = 0, last_us = 0;  ///< of the oldest stored sample and the newest
  };
  [[nodiscard]] std::optional<Span> span() const;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.marks_);
  }

  static constexpr int64_t kExtrapolation_us = 1'000'000;
  static constexpr int64_t kKept_us = 120'000'000;  ///< length of the history

 private:
  struct Mark {
    SpeedSample sample;
    double way = 0.0;   ///< m since the first sample, signed
    double path = 0.0;  ///< m, likewise, total

    template <class Self, class Archive>
    static void members(Self& self, Archive& archive) {
      archive(self.sample, self.way, self.path);
    }
  };
  [[nodiscard]] double distance_at(int64_t t_us) const;
  [[nodiscard]] double sigma_at(int64_t t_us) const;
  [[nodiscard]] double reversal_sigma(int64_t begin_us, int64_t end_us) const;

  std::deque<Mark> marks_;
};

/// Distance from `early`, rescaled to `late` by the ratio of their recent distances, (S.7.5). No value where that ratio
/// is less certain than the scale of `early`.
std::optional<TravelledDistance> rescaled_distance(const DistanceHistory& late, const DistanceHistory& early,
                                                   int64_t begin_us, int64_t end_us);

}  // namespace roadfix
