#include "monitor/screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "geometry/frames.h"

namespace roadfix {

namespace {

/// Letters five lines high, of the three verdicts.
struct Glyph {
  char letter;
  std::array<std::string_view, 5> lines;
};
constexpr std::array<Glyph, 12> kGlyphs = {{{'A', {" ▄▄▄ ", "█   █", "█▄▄▄█", "█   █", "█   █"}},
                                            {'D', {"▄▄▄▄ ", "█   █", "█   █", "█   █", "█▄▄▄▀"}},
                                            {'E', {"▄▄▄▄▄", "█    ", "█▄▄▄ ", "█    ", "█▄▄▄▄"}},
                                            {'G', {" ▄▄▄▄", "█    ", "█  ▄▄", "█   █", "▀▄▄▄█"}},
                                            {'K', {"▄   ▄", "█ ▄▀ ", "██   ", "█ ▀▄ ", "█   █"}},
                                            {'N', {"▄   ▄", "██  █", "█ █ █", "█  ██", "█   █"}},
                                            {'O', {" ▄▄▄ ", "█   █", "█   █", "█   █", "▀▄▄▄▀"}},
                                            {'R', {"▄▄▄▄ ", "█   █", "█▄▄▄▀", "█ ▀▄ ", "█   █"}},
                                            {'S', {" ▄▄▄▄", "█    ", "▀▄▄▄ ", "    █", "▄▄▄▄▀"}},
                                            {'T', {"▄▄▄▄▄", "  █  ", "  █  ", "  █  ", "  █  "}},
                                            {'U', {"▄   ▄", "█   █", "█   █", "█   █", "▀▄▄▄▀"}},
                                            {' ', {"   ", "   ", "   ", "   ", "   "}}}};

constexpr int kGlyphColumns = 6;
constexpr const char* kReset = "\x1b[0m";
constexpr const char* kBold = "\x1b[1m";
constexpr const char* kDim = "\x1b[2m";
constexpr std::array<const char*, 3> kColours = {"\x1b[1;32m", "\x1b[1;33m", "\x1b[1;31m"};

std::string letters(const std::string& words, std::size_t line) {
  std::string text;
  for (const char c : words) {
    const auto* glyph = std::find_if(kGlyphs.begin(), kGlyphs.end(), [c](const Glyph& g) { return g.letter == c; });
    if (glyph != kGlyphs.end()) text += std::string(glyph->lines[line]) + " ";
  }
  return text;
}

std::string duration(double s) {
  if (s < 60.0) return fmt::format("{:.0f} s", s);
  if (s < 3600.0) return fmt::format("{:.0f} min", s / 60.0);
  return fmt::format("{:.1f} h", s / 3600.0);
}

const char* to_words(Validity validity) {
  constexpr std::array<const char*, 3> kWords = {"invalid", "coasting", "valid"};
  return kWords[static_cast<std::size_t>(validity)];
}

const char* to_words(ProcessState state) {
  constexpr std::array<const char*, 5> kWords = {"starting", "running", "no clock", "degraded", "stopped"};
  return kWords[static_cast<std::size_t>(state)];
}

/// Lines of a page that knows its size: each is cut to the width, what does not fit is left out.
class Page {
 public:
  Page(const ScreenSize& size, bool colour) : size_(size), colour_(colour) {}

  void line(const std::string& text, const char* style = nullptr) {
    if (full()) return;
    std::string cut;
    int columns = 0;
    for (const char c : text) {
      const bool continues = (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
      const bool control = static_cast<unsigned char>(c) < 0x20U || c == 0x7F;  // never pass on an escape from the bus
      if (!continues && ++columns > size_.columns) break;
      cut += control ? '?' : c;
    }
    lines_.push_back(style != nullptr && colour_ ? style + cut + kReset : cut);
  }

  [[nodiscard]] bool full() const { return static_cast<int>(lines_.size()) >= size_.rows; }
  [[nodiscard]] int left() const { return size_.rows - static_cast<int>(lines_.size()); }

  [[nodiscard]] std::string text() const {
    std::string all;
    for (int i = 0; i < size_.rows; ++i) {
      if (i > 0) all += "\n";
      if (i < static_cast<int>(lines_.size())) all += lines_[static_cast<std::size_t>(i)];
    }
    return all;
  }

 private:
  ScreenSize size_;
  bool colour_;
  std::vector<std::string> lines_;
};

void put_verdict(Page& page, const HealthReport& report, int columns) {
  const std::string words = to_words(report.verdict);
  const char* colour = kColours[static_cast<std::size_t>(report.verdict)];
  if (static_cast<int>(words.size()) * kGlyphColumns + 1 > columns || page.left() < 12) {
    page.line(" " + words, colour);
    return;
  }
  for (std::size_t i = 0; i < 5; ++i) page.line(" " + letters(words, i), colour);
}

/// What stage integrity bounds the error by.
void put_bound(Page& page, const PoseReport& pose) {
  if (!pose.bound) return;
  const BoundFacts& b = *pose.bound;
  const std::string risk = fmt::format("risk {:g} per pose", b.risk);
  if (!b.level.allFinite()) {
    page.line(fmt::format(" no bound at {}: {}", risk, b.reason), kColours[2]);
    return;
  }
  page.line(fmt::format(" within {:.2f} m along, {:.2f} m across, {:.2f} m up ({}): {}", b.level.x(), b.level.y(),
                        b.level.z(), risk, b.usable ? "usable" : "not usable"),
            b.usable ? nullptr : kColours[1]);
  if (!b.usable && !b.reason.empty()) page.line("   " + b.reason, kColours[1]);
}

void put_estimate(Page& page, const HealthReport& report, int columns) {
  const std::string since = duration(static_cast<double>(report.now_us - report.since_us) * 1e-6);
  for (const PoseReport& pose : report.poses) {
    if (pose.name != report.judged_pose) continue;
    if (pose.validity == Validity::kInvalid) {
      page.line(fmt::format(" {} is invalid{}; this verdict for {}", pose.name,
                            pose.reason.empty() ? "" : ": " + pose.reason, since));
      return;
    }
    const std::string place = fmt::format(" {} {}, sure to {:.2f} m and {:.1f} deg", pose.name, to_words(pose.validity),
                                          pose.position_std, pose.yaw_std / kDegree);
    const std::string rest = fmt::format(" {:.0f} km/h; this verdict for {}", pose.speed * 3.6, since);
    const bool fits = static_cast<int>(place.size() + rest.size()) < columns;
    page.line(fits ? fmt::format("{},{}", place, rest) : place);
    if (!fits) page.line(rest);
    put_bound(page, pose);
    return;
  }
  page.line(fmt::format(" no estimate; this verdict for {}", since));
}

void put_reasons(Page& page, const HealthReport& report) {
  page.line("");
  constexpr std::size_t kMost = 6;
  for (std::size_t i = 0; i < std::min(kMost, report.reasons.size()); ++i) {
    const Condition& reason = report.reasons[i];
    page.line(" ● " + reason.text, kColours[static_cast<std::size_t>(reason.verdict)]);
  }
  if (report.reasons.size() > kMost) page.line(fmt::format("   and {} more", report.reasons.size() - kMost));
  if (report.reasons.empty()) page.line(" nothing to complain about", kDim);
}

void put_channels(Page& page, const HealthReport& report) {
  if (page.left() < 4) return;
  page.line("");
  page.line(fmt::format(" {:<14}{:>8}{:>9}{:>9}{:>9}{:>11}{:>7}{:>7}", "channel", "per s", "wanted", "age s", "late ms",
                        "jitter ms", "lost", "bad"),
            kBold);
  for (const ChannelReport& c : report.channels) {
    if (!is_periodic(c.name)) continue;
    const std::string wanted = c.expected_hz ? fmt::format("{:.4g}", *c.expected_hz) : "?";
    const bool bad = c.silent || c.age_s < 0.0;
    page.line(fmt::format(" {:<14.14}{:>8.1f}{:>9}{:>9.2f}{:>9.0f}{:>11.0f}{:>7}{:>7}", c.name, c.rate_hz, wanted,
                          std::max(0.0, c.age_s), c.latency_s * 1e3, c.jitter_s * 1e3, c.lost, c.undecodable),
              bad ? kColours[1] : nullptr);
  }
}

void put_processes(Page& page, const HealthReport& report) {
  if (page.left() < 3 || report.processes.empty()) return;
  page.line("");
  page.line(
      fmt::format(" {:<18}{:>10}{:>8}{:>8}{:>10}{:>10}", "process", "state", "cpu %", "MiB", "waits s", "restarts"),
      kBold);
  for (const ProcessReport& p : report.processes) {
    const HeartbeatFacts facts = p.newest.value_or(HeartbeatFacts{});
    const char* state = !p.newest ? "missing" : p.silent ? "silent" : to_words(facts.state);
    page.line(fmt::format(" {:<18.18}{:>10}{:>8.1f}{:>8.0f}{:>10.2f}{:>10}", p.name, state, 100.0 * facts.cpu_share,
                          static_cast<double>(facts.rss_bytes) / (1024.0 * 1024.0), facts.queue_age_s, p.restarts),
              !p.newest || p.silent ? kColours[1] : nullptr);
  }
}

void put_consistency(Page& page, const HealthReport& report) {
  if (page.left() < 3 || report.consistency.empty()) return;
  page.line("");
  page.line(fmt::format(" {:<30}{:>10}{:>8}{:>9}", "measurements", "error/claim", "used", "refused"), kBold);
  for (const NisReport& n : report.consistency) {
    if (n.used + n.refused == 0) continue;
    page.line(fmt::format(" {:<30.30}{:>11.2f}{:>8}{:>9}", n.source, n.ratio, n.used, n.refused));
  }
}

}  // namespace

const char* to_words(Verdict verdict) {
  constexpr std::array<const char*, 3> kWords = {"OK", "DEGRADED", "DO NOT USE"};
  return kWords[static_cast<std::size_t>(verdict)];
}

std::string clock_text(int64_t utime) {
  const int64_t s = utime / 1'000'000;
  return fmt::format("{:02}:{:02}:{:02}", s / 3600 % 24, s / 60 % 60, s % 60);
}

std::string render_screen(const HealthReport& report, const ScreenSize& size, bool colour,
                          const std::vector<std::string>& fusion) {
  Page page(size, colour);
  const std::string played =
      report.lag_s != 0.0 ? fmt::format(", a drive of {} ago", duration(std::abs(report.lag_s))) : std::string();
  page.line(fmt::format(" Roadfix {} UTC{}", clock_text(report.now_us), played), kDim);
  put_verdict(page, report, size.columns);
  put_estimate(page, report, size.columns);
  for (const std::string& line : fusion) page.line(" " + line);
  put_reasons(page, report);
  put_channels(page, report);
  put_processes(page, report);
  put_consistency(page, report);
  return page.text();
}

std::string plain_line(const HealthReport& report) {
  std::string line = fmt::format("{} {}", clock_text(report.now_us), to_words(report.verdict));
  for (std::size_t i = 0; i < report.reasons.size(); ++i) line += (i == 0 ? ": " : "; ") + report.reasons[i].text;
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20U || c == 0x7F) c = '?';
  }
  return line;
}

}  // namespace roadfix
