#include "roadfix/import/time_spans.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "config/config_error.h"

namespace roadfix {
namespace {

struct Span {
  std::string file;
  int64_t first_us = 0;
  int64_t last_us = 0;
};

bool apart(const Span& a, const Span& b) { return a.last_us < b.first_us || b.last_us < a.first_us; }

/// The unit that `span` would have to be in to share time with `other`; nothing where no unit makes it.
std::string likely_unit(const Span& span, const Span& other) {
  static const std::vector<std::pair<int64_t, const char*>> units = {{1000, "milliseconds"}, {1'000'000, "seconds"}};
  for (const auto& [microseconds, name] : units) {
    // Whole units: the first and the last may have lost what is less than one.
    const Span rounded{{}, other.first_us / microseconds, other.last_us / microseconds};
    if (!apart(span, rounded)) return name;
  }
  return {};
}

[[noreturn]] void refuse(const Span& wrong, const Span& other, const std::string& unit) {
  throw ConfigError(wrong.file, 0,
                    fmt::format("utime_us from {} to {} shares no moment with {}, {} to {}: {}give both in "
                                "microseconds of one clock, or leave a sensor out with --without",
                                wrong.first_us, wrong.last_us, other.file, other.first_us, other.last_us,
                                unit.empty() ? "" : "it looks like " + unit + "; "));
}

}  // namespace

void refuse_times_apart(const Drive& drive) {
  std::vector<Span> spans;
  const auto add = [&](const char* sensor, const auto& list) {
    if (list.empty()) return;
    const auto file = drive.files.find(sensor);
    spans.push_back({file == drive.files.end() ? sensor : file->second.string(), list.front().t_us, list.back().t_us});
  };
  add("imu", drive.imu);
  add("gnss", drive.gnss);
  add("wheels", drive.wheels);
  add("mag", drive.mag);
  add("frames_left", drive.frames_left);
  add("frames_right", drive.frames_right);
  add("reference", drive.reference);
  add("reference", drive.local_reference);
  std::stable_sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.first_us < b.first_us; });
  for (std::size_t i = 1, last = 0; i < spans.size(); ++i) {
    if (apart(spans[last], spans[i])) {
      const std::string unit = likely_unit(spans[last], spans[i]);
      if (unit.empty()) refuse(spans[i], spans[last], unit);
      refuse(spans[last], spans[i], unit);
    }
    if (spans[i].last_us > spans[last].last_us) last = i;
  }
}

}  // namespace roadfix
