#include "bus/log/log_writer.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "bus/log/log_reader.h"
#include "bus/log/output_place.h"
#include "bus/types/message.h"

namespace roadfix {

namespace {

/// Small enough to be full, and so in memory, after the first second of a drive: what it takes never grows.
constexpr std::size_t kBufferBytes = std::size_t{64} << 10;
constexpr const char* kWriteFailed = "cannot write the log";

/// True where it then is. What is empty is left alone: ext4 sends a file that was ever truncated to the disk when it is
/// closed (auto_da_alloc), also one that is deleted a second later.
bool make_empty(int fd) {
  struct stat file {};
  return ::fstat(fd, &file) == 0 && (file.st_size == 0 || ::ftruncate(fd, 0) == 0);
}

void store(uint8_t* to, uint64_t value, int size) {
  for (int i = 0; i < size; ++i) to[i] = static_cast<uint8_t>(value >> (8 * (size - 1 - i)));
}

}  // namespace

LogWriter::LogWriter(const std::filesystem::path& path, Mode mode) : path_(path), written_path_(path), mode_(mode) {
  if (path.empty()) throw LogError("the log to write has no name");
  if (mode == Mode::kWhole) {
    const OutputPlace place = output_place(path);
    path_ = place.path;
    written_path_ = place.written;
    refuse_non_log();
  }
  fd_ = ::open(written_path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
  if (fd_ < 0) throw_log_error(written_path_, "cannot create the log");
  if (std::filesystem::is_regular_file(written_path_) && (::flock(fd_, LOCK_EX | LOCK_NB) != 0 || !make_empty(fd_))) {
    ::close(fd_);
    throw_log_error(written_path_, "cannot take the log for writing (does another process write it?)");
  }
  buffer_.reserve(kBufferBytes);
}

/// A slip of the finger in --out must not cost a calibration or a table.
void LogWriter::refuse_non_log() const {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path_, ignored) || std::filesystem::file_size(path_, ignored) == 0) return;
  if (!LogReader(path_).next()) throw LogError(path_.string() + ": is there and no log; it would be replaced");
}

LogWriter::~LogWriter() {
  if (fd_ < 0) return;
  if (mode_ == Mode::kWhole) {
    if (written_path_ != path_) ::unlink(written_path_.c_str());
  } else {
    try {
      flush(false);
    } catch (const LogError&) {
      // A destructor cannot report; commit() does.
    }
  }
  ::close(fd_);
}

void LogWriter::write(std::string_view channel, int64_t timestamp_us, std::span<const uint8_t> data) {
  if (channel.empty() || channel.size() > kMaxChannelBytes || data.size() > kMaxMessageBytes) {
    throw LogError(path_.string() + ": channel '" + std::string(channel) + "' with " + std::to_string(data.size()) +
                   " bytes does not fit into an LCM log (names of 1 to 63 characters, 2^28 bytes)");
  }
  uint8_t head[kLogHeadBytes];
  store(head, kLogMagic, 4);
  store(head + 4, static_cast<uint64_t>(events_), 8);
  store(head + 12, static_cast<uint64_t>(timestamp_us), 8);
  store(head + 20, channel.size(), 4);
  store(head + 24, data.size(), 4);
  put(head, sizeof head);
  put(channel.data(), channel.size());
  put(data.data(), data.size());
  ++events_;
}

void LogWriter::put(const void* data, std::size_t size) {
  if (buffer_.size() + size > kBufferBytes) flush(false);
  const auto* begin = static_cast<const uint8_t*>(data);
  if (size > kBufferBytes) {
    // A buffer that took it would keep the size of the largest message ever.
    if (write_some({begin, size}) < size) throw_log_error(written_path_, kWriteFailed);
  } else {
    buffer_.insert(buffer_.end(), begin, begin + size);
  }
  bytes_ += size;
  hash_.add(data, size);
}

/// How much of it the system took; less than all: errno has the reason.
std::size_t LogWriter::write_some(std::span<const uint8_t> data) const {
  std::size_t done = 0;
  while (done < data.size()) {
    const ssize_t n = ::write(fd_, data.data() + done, data.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

void LogWriter::flush(bool to_disk) {
  if (const std::size_t done = write_some(buffer_); done < buffer_.size()) {
    const int why = errno;
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(done));
    errno = why;
    throw_log_error(written_path_, kWriteFailed);
  }
  buffer_.clear();
  if (to_disk && ::fdatasync(fd_) != 0 && errno != EINVAL) throw_log_error(written_path_, kWriteFailed);
}

void LogWriter::commit(bool to_disk) {
  flush(to_disk);
  if (written_path_ != path_ && ::rename(written_path_.c_str(), path_.c_str()) != 0) {
    throw_log_error(path_, "cannot give the log its name");
  }
  ::close(fd_);
  fd_ = -1;
  if (!to_disk) return;
  const std::filesystem::path folder = path_.has_parent_path() ? path_.parent_path() : ".";
  const int folder_fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder_fd >= 0) {
    ::fsync(folder_fd);
    ::close(folder_fd);
  }
}

}  // namespace roadfix
