#include "bus/log/merged_logs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "bus/log/log_survey.h"

namespace roadfix {

namespace {

constexpr int kInspectedEvents = 1000;
/// Recorded this much later than stamped: while an old drive was played.
constexpr int64_t kPlayed_us = 5'000'000;

/// What to add to a log's times so that they are those of its messages.
int64_t shift_of(LogReader& reader) {
  std::vector<int64_t> lags;
  for (int i = 0; i < kInspectedEvents; ++i) {
    const std::optional<LogEvent> event = reader.next();
    if (!event) break;
    const std::optional<Header> header = read_header(event->data);
    if (header && is_plausible(*header)) lags.push_back(event->timestamp_us - header->utime);
  }
  reader.rewind();
  if (lags.empty()) return 0;
  const auto middle = lags.begin() + static_cast<std::ptrdiff_t>(lags.size() / 2);
  std::nth_element(lags.begin(), middle, lags.end());
  return std::abs(*middle) > kPlayed_us ? -*middle : 0;
}

}  // namespace

MergedLogs::MergedLogs(const std::vector<std::filesystem::path>& paths) {
  for (const std::filesystem::path& path : paths) {
    File file;
    file.reader = std::make_unique<LogReader>(path);
    require_our_log(*file.reader);
    file.shift_us = shift_of(*file.reader);
    file.head = file.reader->next();
    files_.push_back(std::move(file));
  }
}

std::optional<MergedLogs::Event> MergedLogs::next() {
  while (const std::optional<Event> event = next_of_any()) {
    const std::optional<Header> header = read_header(event->bytes);
    if (files_.size() == 1 || !header) return event;
    const auto last = last_.find(event->channel);
    if (last == last_.end()) {
      last_.emplace(event->channel, *header);
      return event;
    }
    const Header before = std::exchange(last->second, *header);
    if (before.utime != header->utime || before.run != header->run || before.seq != header->seq) return event;
  }
  return std::nullopt;
}

std::optional<MergedLogs::Event> MergedLogs::next_of_any() {
  File* first = nullptr;
  for (File& file : files_) {
    if (!file.head) continue;
    if (first == nullptr || file.head->timestamp_us + file.shift_us < first->head->timestamp_us + first->shift_us) {
      first = &file;
    }
  }
  if (first == nullptr) return std::nullopt;
  const LogEvent event = *first->head;
  first->head = first->reader->next();
  return Event{event.channel, event.data, event.timestamp_us + first->shift_us};
}

double MergedLogs::share_done() const {
  double done = 0.0, all = 0.0;
  for (const File& file : files_) {
    const auto size = static_cast<double>(file.reader->size_bytes());
    all += size;
    done += file.head ? static_cast<double>(file.head->offset) : size;
  }
  return all > 0.0 ? done / all : 1.0;
}

}  // namespace roadfix
