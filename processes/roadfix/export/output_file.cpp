#include "roadfix/export/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace roadfix {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 16U;

}  // namespace

OutputFile::OutputFile(const std::filesystem::path& path) : standard_output_(path == "-") {
  if (standard_output_) {
    place_ = {"standard output", "standard output"};
    fd_ = STDOUT_FILENO;
    return;
  }
  place_ = output_place(path);
  fd_ = ::open(place_.written.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd_ < 0) fail("cannot be created");
}

OutputFile::~OutputFile() {
  if (standard_output_ || fd_ < 0) return;
  ::close(fd_);
  if (place_.written != place_.path) ::unlink(place_.written.c_str());
}

void OutputFile::fail(const char* what) const {
  throw std::runtime_error(place_.written.string() + ": " + what + ": " + std::strerror(errno));
}

void OutputFile::hand_out(std::span<const uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) fail("cannot be written");
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

void OutputFile::write(std::span<const uint8_t> bytes) {
  if (buffer_.size() + bytes.size() > kBufferBytes) {
    hand_out(buffer_);
    buffer_.clear();
  }
  if (bytes.size() > kBufferBytes) return hand_out(bytes);
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
}

void OutputFile::commit() {
  hand_out(buffer_);
  buffer_.clear();
  if (standard_output_) return;
  if (::fsync(fd_) != 0 && errno != EINVAL) fail("cannot be written");
  if (::close(std::exchange(fd_, -1)) != 0) fail("cannot be written");
  if (place_.written != place_.path && ::rename(place_.written.c_str(), place_.path.c_str()) != 0) {
    fail("cannot be given its name");
  }
}

}  // namespace roadfix
