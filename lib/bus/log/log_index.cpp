#include "bus/log/log_index.h"

#include <algorithm>
#include <map>
#include <tuple>

namespace roadfix {

int LogIndex::channel(const std::string& name) const {
  const auto found = std::lower_bound(channels.begin(), channels.end(), name);
  return found != channels.end() && *found == name ? static_cast<int>(found - channels.begin()) : -1;
}

LogIndex index_logs(const std::vector<LogReader*>& readers,
                    const std::function<bool(std::string_view channel)>& wanted) {
  LogIndex index;
  std::map<std::string, int, std::less<>> numbers;  // -1: not wanted
  for (std::size_t file = 0; file < readers.size(); ++file) {
    readers[file]->rewind();
    while (const std::optional<LogEvent> event = readers[file]->next()) {
      auto found = numbers.find(event->channel);
      if (found == numbers.end()) {
        const int number = wanted(event->channel) ? static_cast<int>(index.channels.size()) : -1;
        if (number >= 0) index.channels.emplace_back(event->channel);
        found = numbers.emplace(event->channel, number).first;
      }
      if (found->second < 0) continue;
      const Header header = read_header(event->data).value_or(Header{event->timestamp_us, 0, 0});
      index.messages.push_back({header, found->second, static_cast<int>(file), event->offset});
    }
  }
  // Channels were numbered as they came; from here on in the order of their names.
  std::vector<std::string> sorted = index.channels;
  std::sort(sorted.begin(), sorted.end());
  std::vector<int> number(index.channels.size());
  for (std::size_t i = 0; i < number.size(); ++i) {
    number[i] = static_cast<int>(std::lower_bound(sorted.begin(), sorted.end(), index.channels[i]) - sorted.begin());
  }
  index.channels = std::move(sorted);
  for (IndexedMessage& message : index.messages) message.channel = number[static_cast<std::size_t>(message.channel)];
  std::sort(index.messages.begin(), index.messages.end(), [](const IndexedMessage& a, const IndexedMessage& b) {
    return std::tie(a.header.utime, a.channel, a.header.run, a.header.seq, a.file, a.offset) <
           std::tie(b.header.utime, b.channel, b.header.run, b.header.seq, b.file, b.offset);
  });
  return index;
}

void remove_duplicates(LogIndex& index, const std::vector<LogReader*>& readers) {
  const auto bytes = [&](const IndexedMessage& m) {
    return readers[static_cast<std::size_t>(m.file)]->at(m.offset).data;
  };
  const auto name = [](const IndexedMessage& m) {
    return std::tie(m.header.utime, m.channel, m.header.run, m.header.seq);
  };
  std::vector<IndexedMessage> kept;
  kept.reserve(index.messages.size());
  for (const IndexedMessage& message : index.messages) {
    bool copy = false;
    for (auto other = kept.rbegin(); other != kept.rend() && !copy && name(*other) == name(message); ++other) {
      copy = other->file != message.file && std::ranges::equal(bytes(*other), bytes(message));
    }
    if (!copy) kept.push_back(message);
  }
  index.messages = std::move(kept);
}

}  // namespace roadfix
