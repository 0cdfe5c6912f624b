/// How far the vehicle has gone between two times, from speeds that arrive with a delay: what gives mono its scale.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "stream/state_bytes.h"

namespace roadfix {

enum class SpeedSource : int8_t { kWheels = 0, kIns = 1 };

struct SpeedSample {
  int64_t t_us = 0;
  SpeedSource source = SpeedSource::kWheels;
  double speed = 0.0;      ///< m/s, negative backwards where it is directed, else a magnitude
  double sigma = 0.0;      ///< m/s, noise of one sample
  double scale_std = 0.0;  ///< relative, the same for all samples of the source
  bool directed = true;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.source, self.speed, self.sigma, self.scale_std, self.directed);
  }
};

constexpr double kMinTravelSigma = 0.005;  ///< m; no speed sensor is better between two pictures

struct Travel {
  double distance = 0.0;  ///< m, from the one place to the other
  double sigma = 0.0;     ///< m, without the scale error that all distances share
  double scale_std = 0.0;
  bool backwards = false;
};

/// Speeds of one source. Between samples the speed runs straight; before the first and after the last it stays, and the
/// doubt grows as a car may brake or pull away.
class TravelHistory {
 public:
  /// Samples come in order of time; an older one is ignored.
  void add(const SpeedSample& sample);

  /// From `begin_us` to `end_us`; nothing where no sample lies within `kReach_us` of both.
  [[nodiscard]] std::optional<Travel> between(int64_t begin_us, int64_t end_us) const;

  struct Span {
    int64_t first_us = 0, last_us = 0;  ///< of the oldest sample kept and the newest
  };
  [[nodiscard]] std::optional<Span> span() const;

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

  static constexpr int64_t kReach_us = 1'000'000;
  static constexpr int64_t kKept_us = 120'000'000;  ///< of the newest samples; older distances are no longer told

 private:
  struct Mark {
    SpeedSample sample;
    double way = 0.0;   ///< m since the first sample ever, signed
    double path = 0.0;  ///< m, likewise, to and fro

    template <class Self, class Archive>
    static void members(Self& self, Archive& archive) {
      archive(self.sample, self.way, self.path);
    }
  };
  [[nodiscard]] double way_at(int64_t t_us) const;
  [[nodiscard]] double doubt_at(int64_t t_us) const;
  [[nodiscard]] double turned_back(int64_t begin_us, int64_t end_us) const;

  std::deque<Mark> marks_;
};

/// The way by `early` in the scale of `late`, as the two have compared of late, (M.8e). Nothing where that is known no
/// better than early's own scale.
std::optional<Travel> in_scale_of(const TravelHistory& late, const TravelHistory& early, int64_t begin_us,
                                  int64_t end_us);

}  // namespace roadfix
