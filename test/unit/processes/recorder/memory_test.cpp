// What the recorder holds in memory does not grow with the drive: neither with the number of messages and files nor
// with the largest message that ever came.
#include <malloc.h>

#include <catch2/catch.hpp>

#include "recorder/message_queue.h"
#include "recorder/recording.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

/// Bytes taken from malloc and not given back; 0 where a sanitizer has its own.
int64_t held_bytes() {
  const struct mallinfo2 info = ::mallinfo2();
  return static_cast<int64_t>(info.uordblks + info.hblkhd);
}

/// Many channels, small messages, and now and then a snapshot, larger from time to time.
class Drive {
 public:
  explicit Drive(const RecorderConfig& config) : queue_(std::size_t{64} << 20), recording_(config, "a") {}

  void go_on(int messages, std::size_t snapshot_bytes) {
    for (int i = 0; i < messages; ++i, ++count_) {
      const bool snapshot = count_ % 100 == 99;
      const std::string channel = snapshot ? "STATE_VO_TRACKER" : "CHANNEL_NUMBER_" + std::to_string(count_ % 40);
      CHECK(queue_.push(channel, count_, std::vector<uint8_t>(snapshot ? snapshot_bytes : 2000, 7)));
      if (i % 10 != 9) continue;
      while (const std::optional<QueuedMessage> message = queue_.pop(std::chrono::milliseconds(0)))
        recording_.write(message->channel, message->received_us, message->data);
      if (i % 200 == 199) recording_.flush(count_);
    }
  }
  void hold(int messages) {
    for (int i = 0; i < messages; ++i) CHECK(queue_.push("HELD", i, std::vector<uint8_t>(100)));
  }
  [[nodiscard]] const Recording& recording() const { return recording_; }

 private:
  MessageQueue queue_;
  Recording recording_;
  int64_t count_ = 0;
};

struct Growth {
  int64_t bytes = 0;
  int64_t files = 0;
};

Growth growth(bool delete_oldest, int held) {
  const test::TemporaryFolder folder;
  RecorderConfig config;
  config.folder = folder.path().string();
  config.min_free = 0.0;
  config.flush_interval = 0.0;
  config.split_size = 1.0;
  config.quota = delete_oldest ? 4.5 / 1024.0 : 0.0;
  config.when_full = delete_oldest ? WhenFull::kDeleteOldest : WhenFull::kStop;
  Drive drive(config);
  drive.go_on(2000, 100'000);
  const int64_t bytes = held_bytes(), files = drive.recording().files_begun();
  drive.go_on(4000, 300'000);
  drive.hold(held);
  return {held_bytes() - bytes, drive.recording().files_begun() - files};
}

TEST_CASE("the recorder's memory does not grow with the number of messages and files, nor with their size") {
  if (held_bytes() == 0) return;
  constexpr int64_t kSlack = 4096;  // a file more or less, a longer path
  const Growth ring = growth(true, 0);
  CHECK(ring.files > 15);
  CHECK(ring.bytes < kSlack);
  // Teeth: what is held for each file that stays, for each message that waits.
  const Growth stays = growth(false, 0);
  CHECK(stays.files > 15);
  CHECK(stays.bytes > 5 * kSlack);
  CHECK(growth(true, 100).bytes > 2 * kSlack);
}

}  // namespace
}  // namespace roadfix
