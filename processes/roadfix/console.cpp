#include "roadfix/console.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>

namespace roadfix {

namespace {

ProgressLine* open_line = nullptr;

}  // namespace

void say(const std::string& command, const std::string& text) {
  if (open_line != nullptr) open_line->end_line();
  std::cout << std::flush;
  std::cerr << fmt::format("roadfix {}: {}\n", command, text) << std::flush;
}

ProgressLine::ProgressLine(std::string command, bool asked_for)
    : command_(std::move(command)), terminal_(::isatty(STDERR_FILENO) == 1), shown_(terminal_ || asked_for) {
  open_line = this;
}

ProgressLine::~ProgressLine() {
  end_line();
  if (open_line == this) open_line = nullptr;
}

void ProgressLine::show(double share, const std::string& detail) {
  if (!shown_) return;
  const double percent = 100.0 * std::clamp(share, 0.0, 1.0);
  const std::string text =
      fmt::format("roadfix {}: {:.0f} %{}{}", command_, percent, detail.empty() ? "" : ", ", detail);
  if (terminal_) {
    std::cerr << fmt::format("\r{:<{}}", text, width_) << std::flush;
    width_ = text.size();
    open_ = true;
    return;
  }
  const int tenth = static_cast<int>(percent / 10.0);
  if (tenth == last_tenth_) return;
  last_tenth_ = tenth;
  std::cerr << text + "\n" << std::flush;
}

void ProgressLine::end_line() {
  if (open_) std::cerr << "\n" << std::flush;
  open_ = false;
  width_ = 0;
}

}  // namespace roadfix
