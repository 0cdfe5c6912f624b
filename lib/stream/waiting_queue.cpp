#include "stream/waiting_queue.h"

#include <algorithm>
#include <tuple>

namespace roadfix {

namespace {

/// Enough for one horizon of a fast sensor; memory beyond it is returned to the allocator.
constexpr std::size_t kMaxFreeBuffers = 64;

auto key(const WaitingInput& waiting) {
  return std::tuple(waiting.effect_utime, waiting.input, waiting.id.run, waiting.id.seq);
}

}  // namespace

bool WaitingQueue::insert(int64_t effect_utime, int input, const EventId& id, std::span<const uint8_t> bytes,
                          bool skipped) {
  WaitingInput waiting{effect_utime, input, id, {}, skipped};
  auto place = queue_.end();  // most inputs belong at or near the end
  while (place != queue_.begin() && key(waiting) < key(*std::prev(place))) --place;
  if (place != queue_.begin() && key(*std::prev(place)) == key(waiting)) return false;
  if (!free_.empty()) {
    waiting.bytes = std::move(free_.back());
    free_.pop_back();
  }
  waiting.bytes.assign(bytes.begin(), bytes.end());
  bytes_ += bytes.size();
  queue_.insert(place, std::move(waiting));
  return true;
}

WaitingInput WaitingQueue::pop() {
  WaitingInput front = std::move(queue_.front());
  queue_.pop_front();
  bytes_ -= front.bytes.size();
  return front;
}

void WaitingQueue::recycle(WaitingInput&& used) {
  if (free_.size() < kMaxFreeBuffers) free_.push_back(std::move(used.bytes));
}

std::vector<int64_t> WaitingQueue::seqs(int input, int64_t run, int64_t before) const {
  std::vector<int64_t> seqs;
  for (const WaitingInput& waiting : queue_) {
    if (waiting.input == input && waiting.id.run == run && waiting.id.seq < before) seqs.push_back(waiting.id.seq);
  }
  std::sort(seqs.begin(), seqs.end());
  return seqs;
}

std::size_t WaitingQueue::depth(int input) const {
  return static_cast<std::size_t>(
      std::count_if(queue_.begin(), queue_.end(), [&](const WaitingInput& w) { return w.input == input; }));
}

}  // namespace roadfix
