#include "recorder/recording_thread.h"

#include "bus/run/run_clock.h"

namespace roadfix {

namespace {
constexpr auto kPollTimeout = std::chrono::milliseconds(50);
constexpr int64_t kTryAgain_us = 500'000;
}  // namespace

RecordingThread::RecordingThread(const RecorderConfig& config, const std::string& name)
    : queue_(static_cast<std::size_t>(config.memory * kMebi)), recording_(config, name), thread_([this] { work(); }) {}

void RecordingThread::push(const BusMessage& message) {
  queue_.push(std::string(message.channel), message.received_us, message.bytes);
}

void RecordingThread::finish() {
  done_ = true;
  if (thread_.joinable()) thread_.join();
}

std::optional<std::string> RecordingThread::stopped() const {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

void RecordingThread::work() {
  RunClock clock;
  while (true) {
    const bool last_round = done_;
    while (const std::optional<QueuedMessage> message =
               queue_.pop(last_round ? std::chrono::milliseconds(0) : kPollTimeout)) {
      recording_.write(message->channel, message->received_us, message->data);
      recording_.flush(clock.now_utime());
      look(clock.now_utime());
    }
    recording_.flush(clock.now_utime());
    look(clock.now_utime());
    if (last_round) break;
  }
  recording_.note_dropped(queue_.dropped());
  recording_.close();
}

void RecordingThread::look(int64_t now_us) {
  bool stopped = recording_.state() == Recording::State::kStopped;
  if (stopped && now_us - tried_us_ > kTryAgain_us) {
    tried_us_ = now_us;
    stopped = !recording_.try_again();
  }
  const std::lock_guard lock(mutex_);
  if (stopped != stopped_.has_value()) stopped_ = stopped ? std::optional(recording_.reason()) : std::nullopt;
}

}  // namespace roadfix
