#include "roadfix/import/gnss_changes.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "geodesy/enu_anchor.h"
#include "geometry/frames.h"

namespace roadfix {
namespace {

constexpr double kShortestCut = 1e-3;    // s
constexpr double kLongestChange = 1e6;   // s, eleven days: longer than any drive
constexpr double kFarthestChange = 1e6;  // m

struct Window {
  int64_t start_us = 0;
  int64_t end_us = 0;
};

int64_t microseconds(double seconds) { return std::llround(seconds * 1e6); }

std::vector<Window> windows_of(const CutGnss& cut, int64_t first_fix_us, int64_t last_fix_us) {
  std::vector<Window> windows;
  const int64_t latest_end = last_fix_us - microseconds(kWindowMargin);
  for (int64_t k = 0;; ++k) {
    const int64_t start = first_fix_us + microseconds(cut.after + cut.phase + static_cast<double>(k) * cut.every);
    const Window window{start, start + microseconds(cut.length)};
    if (window.end_us > latest_end) return windows;
    windows.push_back(window);
  }
}

void require(bool ok, const char* message) {
  if (!ok) throw std::runtime_error(message);
}

void check(const GnssChanges& changes) {
  // Comparisons that hold, so that a NaN fails each.
  const auto time = [](double seconds) { return seconds >= 0.0 && seconds <= kLongestChange; };
  const auto way = [](double moved) { return std::abs(moved) <= kFarthestChange; };
  require(changes.keep_every >= 1, "--gnss-every must be at least 1");
  if (changes.cut) {
    require(changes.cut->length >= kShortestCut && time(changes.cut->length),
            "--cut-gnss must be within 0.001 and 1e6 s");
    require(changes.cut->every >= changes.cut->length && time(changes.cut->every),
            "--every must not be shorter than --cut-gnss, nor longer than 1e6 s");
    require(time(changes.cut->after) && time(changes.cut->phase), "--after and --phase must be within 0 and 1e6 s");
  }
  require(!changes.spike || way(changes.spike->moved), "--gnss-spike must be within -1e6 and 1e6 m");
  require(!changes.bias_after_outage || way(changes.bias_after_outage->moved),
          "--gnss-bias-after-outage must be within -1e6 and 1e6 m");
  require(!changes.spike || changes.spike->every_fix >= 1, "--every-fix must be at least 1");
  require(!changes.bias_after_outage || changes.cut, "--gnss-bias-after-outage needs --cut-gnss");
  require(!changes.bias_after_outage || changes.bias_after_outage->fixes >= 1, "--fixes must be at least 1");
}

/// Directions from a seed: uniform over the circle, the same on every machine (no std::distribution).
class Azimuths {
 public:
  explicit Azimuths(uint64_t seed) : random_(seed) {}
  double next() { return 2.0 * kPi * static_cast<double>(random_() >> 11U) * 0x1p-53; }

 private:
  std::mt19937_64 random_;
};

/// `distance` m towards `azimuth` (clockwise from north); the height stays.
Geodetic moved(const Geodetic& from, double distance, double azimuth) {
  Geodetic to = EnuAnchor(from).geodetic({distance * std::sin(azimuth), distance * std::cos(azimuth), 0.0});
  to.height = from.height;
  return to;
}

/// Fills everything but moved_utimes; returns for each kept fix its index in the source.
std::vector<std::size_t> withhold(const std::vector<GnssFix>& source, const GnssChanges& changes, ChangedGnss& result) {
  std::vector<Window> windows;
  if (changes.cut) windows = windows_of(*changes.cut, source.front().t_us, source.back().t_us);
  std::vector<std::size_t> kept;
  std::size_t window = 0;  // the first that does not lie wholly behind
  bool inside = false;     // it has withheld a fix already
  for (std::size_t i = 0; i < source.size(); ++i) {
    const int64_t t_us = source[i].t_us;
    while (window < windows.size() && t_us >= windows[window].end_us) {
      ++window;
      inside = false;
    }
    if (window < windows.size() && t_us >= windows[window].start_us) {
      if (!inside) result.outages.push_back({t_us, t_us, t_us});
      inside = true;
      result.outages.back().last_withheld_us = result.outages.back().return_us = t_us;
      result.withheld_utimes.push_back(t_us);
    } else if (i % static_cast<std::size_t>(changes.keep_every) != 0) {
      result.withheld_utimes.push_back(t_us);
    } else {
      if (!result.outages.empty() && result.outages.back().return_us == result.outages.back().last_withheld_us) {
        result.outages.back().return_us = t_us;
      }
      result.fixes.push_back(source[i]);
      kept.push_back(i);
    }
  }
  return kept;
}

/// Moves result.fixes; `kept` are their indices in the source.
void move_fixes(const std::vector<std::size_t>& kept, const GnssChanges& changes, ChangedGnss& result) {
  Azimuths spike_azimuths(changes.azimuth_seed);
  Azimuths bias_azimuths(changes.azimuth_seed);
  double bias_azimuth = 0.0;
  int to_bias = 0;
  std::size_t outage = 0;  // the next one that ends
  for (std::size_t k = 0; k < kept.size(); ++k) {
    GnssFix& fix = result.fixes[k];
    for (; outage < result.outages.size() && fix.t_us >= result.outages[outage].return_us; ++outage) {
      to_bias = changes.bias_after_outage ? changes.bias_after_outage->fixes : 0;
      bias_azimuth = bias_azimuths.next();
    }
    const bool is_spike = changes.spike && (kept[k] + 1) % static_cast<std::size_t>(changes.spike->every_fix) == 0;
    if (is_spike) fix.antenna = moved(fix.antenna, changes.spike->moved, spike_azimuths.next());
    if (to_bias > 0) fix.antenna = moved(fix.antenna, changes.bias_after_outage->moved, bias_azimuth);
    if (is_spike || to_bias > 0) result.moved_utimes.push_back(fix.t_us);
    to_bias = std::max(0, to_bias - 1);
  }
}

}  // namespace

ChangedGnss change_gnss(const std::vector<GnssFix>& source, const GnssChanges& changes) {
  check(changes);
  ChangedGnss result;
  if (source.empty()) return result;
  const std::vector<std::size_t> kept = withhold(source, changes, result);
  move_fixes(kept, changes, result);
  return result;
}

}  // namespace roadfix
