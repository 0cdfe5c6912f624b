#include "monitor/web/board.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "bus/types/message.h"

namespace roadfix {

void Board::put_frame(std::string json) {
  auto text = std::make_shared<const std::string>(std::move(json));
  const std::lock_guard lock(mutex_);
  frame_ = text;
  const auto number = static_cast<std::size_t>(frame_number_++);
  if (!keep_frames_ || number % keep_every_ != 0) return;
  frames_.push_back(std::move(text));
  if (frames_.size() <= kMostFrames) return;
  for (std::size_t i = 0; 2 * i < frames_.size(); ++i) frames_[i] = frames_[2 * i];
  frames_.resize((frames_.size() + 1) / 2);
  keep_every_ *= 2;
}

void Board::put_picture(int64_t utime, Picture picture) {
  put_picture(utime, [picture = std::move(picture)] { return picture; });
}

void Board::put_picture(int64_t utime, std::function<Picture()> fetch) {
  const std::lock_guard lock(mutex_);
  pictures_.push_back({utime, std::move(fetch)});
  if (!keep_frames_ && pictures_.size() > kRecentPictures) pictures_.pop_front();
}

Board::Text Board::frame() const {
  const std::lock_guard lock(mutex_);
  return frame_;
}

std::string Board::frames(std::size_t from, std::size_t count) const {
  std::vector<Text> some;
  {
    const std::lock_guard lock(mutex_);
    const std::size_t first = std::min(from, frames_.size());
    const std::size_t last = first + std::min(count, frames_.size() - first);
    some.assign(frames_.begin() + static_cast<std::ptrdiff_t>(first),
                frames_.begin() + static_cast<std::ptrdiff_t>(last));
  }
  std::string json = "[";
  for (const Text& frame : some) json += (json.size() > 1 ? "," : "") + *frame;
  return json + "]";
}

std::optional<WebPicture> Board::picture(int64_t utime) const {
  std::function<Picture()> fetch;
  {
    const std::lock_guard lock(mutex_);
    const auto after = std::upper_bound(pictures_.begin(), pictures_.end(), utime,
                                        [](int64_t t, const Pinned& pinned) { return t < pinned.utime; });
    if (after == pictures_.begin()) return std::nullopt;
    fetch = std::prev(after)->fetch;
  }
  const Picture picture = fetch();
  return picture ? web_picture(decode<image_t>(*picture)) : std::nullopt;
}

std::string Board::about() const {
  const std::lock_guard lock(mutex_);
  return nlohmann::ordered_json{{"mode", keep_frames_ ? "log" : "live"},
                                {"name", name_},
                                {"frames", frames_.size()},
                                {"done", static_cast<double>(done_)}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Board::Text Board::history_json() {
  const std::size_t size = history_.size();
  if (!history_json_ || size != history_size_) {
    history_json_ = std::make_shared<const std::string>(history_.json());
    history_size_ = size;
  }
  return history_json_;
}

}  // namespace roadfix
