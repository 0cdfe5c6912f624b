#include "stream/lateness_estimator.h"

#include <algorithm>

namespace roadfix {

LatenessEstimator::LatenessEstimator(const std::vector<InputSpec>& inputs)
    : now_(inputs.size()), before_(inputs.size()) {
  for (const InputSpec& input : inputs) stated_us_.push_back(input.lateness_us);
  most_us_ = largest_lateness_us(inputs);
  allowed_us_ = std::min(kMinLateness_us, most_us_);
}

void LatenessEstimator::Latest::add(int64_t lateness_us) {
  if (lateness_us <= us[1]) return;
  us[1] = std::min(lateness_us, us[0]);
  us[0] = std::max(lateness_us, us[0]);
}

void LatenessEstimator::note(int input, int64_t clock_utime, int64_t utime) {
  const auto i = static_cast<std::size_t>(input);
  const int64_t lateness_us = clock_utime - utime;
  if (lateness_us <= stated_us_[i]) now_[i].add(lateness_us);
}

int64_t LatenessEstimator::required_us() const {
  int64_t latest_us = 0;
  for (std::size_t i = 0; i < now_.size(); ++i) {
    Latest both = before_[i];
    for (const int64_t us : now_[i].us) both.add(us);
    latest_us = std::max(latest_us, both.us[1]);
  }
  const int64_t with_margin_us = latest_us + latest_us / 2;
  const int64_t steps = (with_margin_us + kStep_us - 1) / kStep_us;
  return std::min(std::max(steps * kStep_us, kMinLateness_us), most_us_);
}

std::optional<int64_t> LatenessEstimator::change(int64_t clock_utime) {
  const int64_t window = clock_utime / kWindow_us;
  const bool window_ended = window_ && window != *window_;
  window_ = window;
  if (window_ended) {
    before_ = std::move(now_);
    now_.assign(before_.size(), {});
  }
  const int64_t wanted = required_us();
  if (wanted == allowed_us_ || (wanted < allowed_us_ && !window_ended)) return std::nullopt;
  allowed_us_ = wanted;
  return wanted;
}

}  // namespace roadfix
