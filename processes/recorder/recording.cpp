#include "recorder/recording.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "recorder/sidecar.h"

namespace roadfix {
namespace fs = std::filesystem;

namespace {

constexpr double kMicrosecond = 1e-6;
/// What must be free beyond the least before a stopped recording goes on: some seconds of a drive.
constexpr double kRoom = 8.0 * kMebi;

/// "20260101T000000Z.012.lcm": its drive, whose name begins with the UTC time of its start, and its number in it.
std::pair<std::string, int64_t> place_of(const fs::path& log) {
  const fs::path name = log.stem();
  return {name.stem().string(), std::atoll(name.extension().string().substr(name.has_extension() ? 1 : 0).c_str())};
}

/// A clock that is not set begins each drive at the same second: what a drive before this one recorded stays.
std::string unused_name(const fs::path& folder, const std::string& wanted) {
  const auto used = [&](const std::string& name) {
    return fs::exists(folder / (name + ".json")) || fs::exists(folder / (name + ".000.lcm"));
  };
  std::string name = wanted;
  for (int i = 2; used(name); ++i) name = fmt::format("{}-{}", wanted, i);
  return name;
}

/// MiB that a file may grow to: a limit of the system's (ulimit -f) splits, too, so that nothing is lost to it.
double largest_file(double wanted) {
  constexpr double kHead = 128.0;  // more than an event has beside its data
  rlimit limit{};
  if (::getrlimit(RLIMIT_FSIZE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return wanted;
  return std::min(wanted, (static_cast<double>(limit.rlim_cur) - kHead) / kMebi);
}

}  // namespace

uint64_t free_space(const fs::path& folder) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  return error ? 0 : space.available;
}

Recording::Recording(const RecorderConfig& config, const std::string& name, FreeSpace free)
    : config_(config), folder_(config.folder), free_(std::move(free)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) throw LogError(folder_.string() + ": cannot make the folder for recordings: " + error.message());
  name_ = unused_name(folder_, name);
  config_.split_size = largest_file(config_.split_size);
  open_next();
  check_space();
}

Recording::~Recording() { close(); }

void Recording::open_next() {
  const fs::path path = folder_ / fmt::format("{}.{:03}.lcm", name_, files_begun_);
  log_ = std::make_unique<LogWriter>(path, LogWriter::Mode::kRecording);
  ++files_begun_;
  files_.push_back(path);
  facts_.emplace_back().name = path.filename().string();
  write_sidecar();
}

void Recording::finish_file() {
  if (!log_) return;
  facts_.back().bytes = log_->bytes();
  facts_.back().hash = log_->hash();
  const std::unique_ptr<LogWriter> closing = std::move(log_);
  closing->commit();
}

void Recording::split() {
  if (state_ == State::kStopped || log_->events() == 0) return;
  try {
    finish_file();
    open_next();
  } catch (const LogError& e) {
    stop(e.what());
  }
}

void Recording::stop(const std::string& reason) {
  if (state_ == State::kStopped) return;
  state_ = State::kStopped;
  reason_ = reason;
  try {
    finish_file();
  } catch (const LogError&) {
    // The disk takes no more: what it has is intact up to the last whole event, and the reason is kept.
  }
  write_sidecar();
}

void Recording::write(const std::string& channel, int64_t received_us, std::span<const uint8_t> data) {
  if (state_ == State::kStopped) {
    ++unwritten_;
    return;
  }
  FileFacts& facts = facts_.back();
  const bool too_long =
      facts.first_us != 0 && static_cast<double>(received_us - facts.first_us) * kMicrosecond >= config_.split_time;
  if (too_long || static_cast<double>(log_->bytes() + data.size()) > config_.split_size * kMebi) split();
  if (state_ == State::kStopped) {
    ++unwritten_;
    return;
  }
  try {
    log_->write(channel, received_us, data);
  } catch (const LogError& e) {
    ++unwritten_;
    stop(e.what());
    return;
  }
  FileFacts& current = facts_.back();
  if (current.first_us == 0) current.first_us = received_us;
  current.last_us = std::max(current.last_us, received_us);
  ++current.events[channel];
}

void Recording::flush(int64_t now_us) {
  if (state_ == State::kStopped || static_cast<double>(now_us - flushed_us_) * kMicrosecond < config_.flush_interval)
    return;
  flushed_us_ = now_us;
  try {
    log_->flush(true);
  } catch (const LogError& e) {
    stop(e.what());
    return;
  }
  check_space();
}

uint64_t Recording::recorded_bytes() const {
  uint64_t total = 0;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error))
    if (entry.path().extension() == ".lcm") total += entry.file_size(error);
  return total;
}

bool Recording::delete_oldest() {
  std::vector<fs::path> logs;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error))
    if (entry.path().extension() == ".lcm" && entry.path() != files_.back()) logs.push_back(entry.path());
  const auto oldest = std::min_element(logs.begin(), logs.end(),
                                       [](const fs::path& a, const fs::path& b) { return place_of(a) < place_of(b); });
  if (oldest == logs.end() || !fs::remove(*oldest, error)) return false;
  forget(*oldest);
  return true;
}

void Recording::forget(const fs::path& file) {
  const auto ours = std::find(files_.begin(), files_.end(), file);
  if (ours == files_.end()) return;
  facts_.erase(facts_.begin() + (ours - files_.begin()));
  files_.erase(ours);
}

std::string Recording::lack_of_space() const {
  const double left = static_cast<double>(free_(folder_)) / kGibi;
  if (left < config_.min_free)
    return fmt::format("{:.2f} GiB left on the disk of {}, min_free_gib is {}", left, folder_.string(),
                       config_.min_free);
  if (config_.quota <= 0.0) return "";
  const double used = static_cast<double>(recorded_bytes()) / kGibi;
  return used > config_.quota
             ? fmt::format("{:.2f} GiB recorded in {}, quota_gib is {}", used, folder_.string(), config_.quota)
             : "";
}

void Recording::check_space() {
  std::string why = lack_of_space();
  while (!why.empty() && config_.when_full == WhenFull::kDeleteOldest && delete_oldest()) why = lack_of_space();
  if (!why.empty()) stop(why);
}

bool Recording::try_again() {
  if (state_ == State::kRecording) return true;
  if (static_cast<double>(free_(folder_)) < config_.min_free * kGibi + kRoom || !lack_of_space().empty()) return false;
  try {
    open_next();
  } catch (const LogError&) {
    return false;  // the reason for which it stopped stands
  }
  state_ = State::kRecording;
  earlier_reason_ = reason_;
  reason_.clear();
  return true;
}

void Recording::write_sidecar() const {
  Sidecar sidecar;
  sidecar.stopped_because = reason_;
  if (reason_.empty() && !earlier_reason_.empty()) sidecar.stopped_because = "for a while: " + earlier_reason_;
  sidecar.dropped = dropped_;
  sidecar.unwritten = unwritten_;
  sidecar.deleted_files = files_begun_ - static_cast<int64_t>(files_.size());
  for (const FileFacts& f : facts_) sidecar.files.push_back({f.name, f.first_us, f.last_us, f.bytes, f.hash, f.events});
  roadfix::write_sidecar(folder_ / (name_ + ".json"), sidecar);
}

void Recording::close() {
  if (state_ == State::kRecording)
    stop("");
  else
    write_sidecar();
}

}  // namespace roadfix
