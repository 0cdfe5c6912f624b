#include "pose_server/sentence_queue.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace roadfix {

void SentenceQueue::add(std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1) + 1;
    if (waiting_.size() + end > most_bytes_) {
      ++left_out_;
    } else {
      waiting_ += text.substr(0, end);
    }
    text.remove_prefix(end);
  }
}

bool SentenceQueue::flush(int descriptor, Clock::time_point now) {
  if (!waits_) taken_ = now;
  bool intact = true;
  while (!waiting_.empty()) {
    ssize_t size = ::send(descriptor, waiting_.data(), waiting_.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (size < 0 && errno == ENOTSOCK) size = ::write(descriptor, waiting_.data(), waiting_.size());
    if (size <= 0) {
      intact = size < 0 && (errno == EAGAIN || errno == EINTR);
      break;
    }
    taken_ = now;
    waiting_.erase(0, static_cast<std::size_t>(size));
  }
  waits_ = !waiting_.empty();
  return intact;
}

}  // namespace roadfix
