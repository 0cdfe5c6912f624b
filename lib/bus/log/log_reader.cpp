#include "bus/log/log_reader.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>

namespace roadfix {

namespace {
constexpr uint8_t kMagicBytes[4] = {0xED, 0xA1, 0xDA, 0x01};
}  // namespace

LogReader::LogReader(const std::filesystem::path& path) : path_(path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe is none, and would be waited for
  if (fd < 0) throw_log_error(path, "cannot open the log");
  struct stat status {};
  if (::fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(fd);
    throw LogError(path.string() + ": not a regular file");
  }
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size > 0) {
    void* mapped = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, fd, 0);
    if (mapped == MAP_FAILED) {
      ::close(fd);
      throw_log_error(path, "cannot map the log");
    }
    file_ = {static_cast<const uint8_t*>(mapped), size};
    mapped_ = true;
  }
  ::close(fd);
}

LogReader::~LogReader() {
  if (mapped_) ::munmap(const_cast<uint8_t*>(file_.data()), file_.size());
}

std::optional<LogEvent> LogReader::next() {
  while (position_ < file_.size()) {
    const std::optional<LogEvent> event = parse_log_event(file_, position_);
    if (!event) {
      const uint64_t resume = find_event(position_ + 1);
      note_damage(position_, resume, resume == file_.size() ? "the last event is cut off" : "no event head here");
      position_ = resume;
      continue;
    }
    const uint64_t end = position_ + log_event_bytes(*event);
    if (end < file_.size() && !parse_log_event(file_, end)) {
      // Either what follows is damaged, or this event's own length: then a whole event lies inside it.
      const uint64_t inside = find_event(position_ + kLogHeadBytes);
      if (inside < end) {
        note_damage(position_, inside, "an event's length is wrong");
        position_ = inside;
        continue;
      }
    }
    position_ = end;
    return event;
  }
  return std::nullopt;
}

void LogReader::require_events() {
  rewind();
  if (!next()) {
    const bool begins =
        file_.size() >= sizeof kMagicBytes && std::memcmp(file_.data(), kMagicBytes, sizeof kMagicBytes) == 0;
    throw LogError(path_.string() + (file_.empty() ? ": is empty: a log without an event"
                                     : begins      ? ": is cut off within its first event"
                                                   : ": is no LCM log: no event in it"));
  }
  rewind();
}

LogEvent LogReader::at(uint64_t offset) const {
  const std::optional<LogEvent> event = parse_log_event(file_, offset);
  if (!event) throw LogError(path_.string() + ": no event at byte " + std::to_string(offset));
  return *event;
}

uint64_t LogReader::find_event(uint64_t from) const {
  while (from < file_.size()) {
    const void* hit = ::memmem(file_.data() + from, file_.size() - from, kMagicBytes, sizeof kMagicBytes);
    if (hit == nullptr) break;
    const auto offset = static_cast<uint64_t>(static_cast<const uint8_t*>(hit) - file_.data());
    if (parse_log_event(file_, offset)) return offset;
    from = offset + 1;
  }
  return file_.size();
}

void LogReader::note_damage(uint64_t begin, uint64_t end, const std::string& what) {
  if (!damage_.empty() && begin <= damage_.back().offset) return;  // a second pass over the file
  damage_.push_back({begin, end - begin, what});
}

}  // namespace roadfix
