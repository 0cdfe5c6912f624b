/// The monitor's page for a terminal: the verdict in letters that can be read from the driver's seat, then why, then
/// the figures behind it, as many as there is room for.
#pragma once

#include <string>
#include <vector>

#include "health/health.h"

namespace roadfix {

struct ScreenSize {
  int columns = 80;
  int rows = 24;
};

/// Exactly `rows` lines of at most `columns` characters (UTF-8), colours as escape sequences where asked for. `fusion`: what
/// the fusion does, one line each.
std::string render_screen(const HealthReport& report, const ScreenSize& size, bool colour,
                          const std::vector<std::string>& fusion = {});

/// The verdict and its reasons in one line, for where there is no terminal.
std::string plain_line(const HealthReport& report);

const char* to_words(Verdict verdict);

/// 12:31:07 of the day, UTC.
std::string clock_text(int64_t utime);

}  // namespace roadfix
