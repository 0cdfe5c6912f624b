#include "drivers/device/device_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

namespace roadfix {

bool DeviceSession::open(Clock::time_point now) {
  try {
    source_ = open_();
  } catch (const SourceError& e) {
    disconnect(now, e.what());
    return false;
  }
  last_data_ = now;
  reason_.clear();
  ++openings_;
  return true;
}

void DeviceSession::disconnect(Clock::time_point now, const std::string& why) {
  source_.reset();
  reason_ = why;
  const std::chrono::duration<double> first(config_.reopen_first), most(config_.reopen_max);
  pause_ = pause_ == pause_.zero() ? first : std::min(2.0 * pause_, most);
  due_ = now + std::chrono::duration_cast<Clock::duration>(pause_);
}

bool DeviceSession::step(Clock::time_point now, std::chrono::milliseconds timeout, std::vector<Packet>& packets) {
  if (ended_) return false;
  if (!source_) {
    if (!due_ || now >= *due_) return open(now);
    std::this_thread::sleep_for(std::min<Clock::duration>(timeout, *due_ - now));
    return false;
  }
  switch (source_->read(timeout, packets)) {
    case ReadState::kData:
      last_data_ = now;
      pause_ = pause_.zero();
      break;
    case ReadState::kNothing:
      break;
    case ReadState::kEnd:
      ended_ = true;
      break;
    case ReadState::kLost:
      disconnect(now, name() + ": went away");
      break;
  }
  return false;
}

std::string DeviceSession::state_reason(Clock::time_point now) const {
  if (ended_) return {};
  if (!source_) {
    if (reason_.empty()) return config_.device + ": not opened yet";
    const double wait_s = due_ ? std::max(0.0, std::chrono::duration<double>(*due_ - now).count()) : 0.0;
    return fmt::format("{}; tried again in {:.1f} s", reason_, wait_s);
  }
  const double silent_s = std::chrono::duration<double>(now - last_data_).count();
  return silent_s > config_.silence ? fmt::format("{}: no byte for {:.0f} s", name(), silent_s) : std::string();
}

}  // namespace roadfix
