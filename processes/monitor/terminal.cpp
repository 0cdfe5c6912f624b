#include "monitor/terminal.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>

#include "bus/types/message.h"
#include "monitor/messages.h"
#include "monitor/screen.h"

namespace roadfix {

namespace {

constexpr int64_t kRedraw_us = 500'000;
constexpr int64_t kLine_us = 10'000'000;
constexpr int64_t kFusion_us = 2'000'000;  // older than this it says nothing of now
constexpr const char* kEnter = "\x1b[?1049h\x1b[?25l\x1b[2J";
constexpr const char* kLeave = "\x1b[?25h\x1b[?1049l";

ScreenSize screen_size() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {};
  return {size.ws_col, size.ws_row};
}

/// A stopped terminal (Ctrl-S) must not stop the monitor.
bool takes_output() {
  pollfd fd{STDOUT_FILENO, POLLOUT, 0};
  return poll(&fd, 1, 0) == 1 && (fd.revents & POLLOUT) != 0;
}

}  // namespace

Terminal::Terminal(bool plain, const std::string& footer)
    : in_place_(!plain && isatty(STDOUT_FILENO) == 1), footer_(footer) {
  if (in_place_) {
    std::cout << kEnter << std::flush;
  } else if (!footer_.empty()) {
    std::cout << footer_ << std::endl;
  }
}

Terminal::~Terminal() {
  if (in_place_) std::cout << kLeave << std::flush;
}

void Terminal::message(const std::string&, const std::string& type, const BusMessage& message, int64_t now_us) {
  if (type != "fusion_state2_t") return;
  fusion_ = fusion_lines(decode<fusion_state2_t>(message.bytes));
  fusion_us_ = now_us;
}

void Terminal::decided(const HealthReport& report, bool changed) {
  const int64_t period_us = in_place_ ? kRedraw_us : kLine_us;
  if ((!changed && report.now_us - drawn_us_ < period_us) || !takes_output()) return;
  drawn_us_ = report.now_us;
  if (in_place_) {
    draw(report);
  } else {
    std::cout << plain_line(report) << std::endl;
  }
}

void Terminal::draw(const HealthReport& report) {
  const ScreenSize size = screen_size();
  const char* no_colour = std::getenv("NO_COLOR");
  const std::string page =
      render_screen(report, {size.columns, size.rows - 1}, no_colour == nullptr || *no_colour == 0,
                    report.now_us - fusion_us_ < kFusion_us ? fusion_ : std::vector<std::string>{});
  std::string text = "\x1b[H";
  for (const char c : page) text += c == '\n' ? std::string("\x1b[K\r\n") : std::string(1, c);
  text += "\x1b[K\r\n " + footer_.substr(0, static_cast<std::size_t>(std::max(0, size.columns - 2))) + "\x1b[K";
  std::cout << text << std::flush;
}

}  // namespace roadfix
