#include "drivers/device/threaded_source.h"

#include <condition_variable>
#include <iterator>
#include <mutex>
#include <optional>
#include <thread>

namespace roadfix {

namespace {
constexpr auto kPollTimeout = std::chrono::milliseconds(100);
constexpr auto kShutdownTimeout = std::chrono::milliseconds(300);
/// Packets that wait for the driver; beyond it the source is not read, and drops what it likes.
constexpr std::size_t kMaxWaiting = 4;

int64_t steady_us() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}
}  // namespace

struct ThreadedSource::Shared {
  std::mutex mutex;
  std::condition_variable changed;
  std::unique_ptr<ByteSource> source;  ///< the thread's
  std::vector<Packet> waiting;
  std::optional<ReadState> over;  ///< kEnd or kLost, behind the packets that wait
  bool unwanted = false;          ///< nobody reads any more
  bool ended = false;             ///< the thread
};

ThreadedSource::ThreadedSource(const Open& open, Now now) : shared_(std::make_shared<Shared>()), now_(std::move(now)) {
  shared_->source = open(steady_us);
  name_ = shared_->source->name();
  std::thread([shared = shared_] { read_all(shared); }).detach();
}

ThreadedSource::~ThreadedSource() {
  std::unique_lock lock(shared_->mutex);
  shared_->unwanted = true;
  shared_->changed.notify_all();
  shared_->changed.wait_for(lock, kShutdownTimeout, [this] { return shared_->ended; });
}

void ThreadedSource::read_all(const std::shared_ptr<Shared>& shared) {
  std::vector<Packet> packets;
  std::unique_lock lock(shared->mutex);
  while (!shared->unwanted && !shared->over) {
    lock.unlock();
    packets.clear();
    const ReadState state = shared->source->read(kPollTimeout, packets);
    lock.lock();
    std::move(packets.begin(), packets.end(), std::back_inserter(shared->waiting));
    if (state == ReadState::kEnd || state == ReadState::kLost) shared->over = state;
    shared->changed.notify_all();
    shared->changed.wait(lock, [&] { return shared->unwanted || shared->waiting.size() < kMaxWaiting; });
  }
  lock.unlock();
  shared->source.reset();  // before anybody opens the device again
  lock.lock();
  shared->ended = true;
  shared->changed.notify_all();
}

ReadState ThreadedSource::read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) {
  std::unique_lock lock(shared_->mutex);
  shared_->changed.wait_for(lock, timeout, [this] { return shared_->over || !shared_->waiting.empty(); });
  if (shared_->waiting.empty()) return shared_->over.value_or(ReadState::kNothing);
  const int64_t now = now_(), steady = steady_us();
  for (Packet& packet : shared_->waiting) {
    if (packet.utime != 0) packet.utime += now - steady;
    packets.push_back(std::move(packet));
  }
  shared_->waiting.clear();
  shared_->changed.notify_all();
  return ReadState::kData;
}

}  // namespace roadfix
