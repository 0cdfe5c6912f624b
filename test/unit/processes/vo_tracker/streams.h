/// Messages to a stage under test, and its outputs.
#pragma once

#include <opencv2/imgcodecs.hpp>
#include <roadfix/image_t.hpp>

#include "bus/run/stage_runner.h"
#include "bus/types/message.h"
#include "support/street.h"

namespace roadfix::test {

struct Sent {
  int64_t arrival_us = 0;
  std::string channel;
  std::vector<uint8_t> bytes;
};

template <class T>
Sent sent(const std::string& channel, int64_t utime, int64_t seq, T message, int64_t delay_us = 0) {
  message.utime = utime;
  message.run = 1;
  message.seq = seq;
  return {utime + delay_us, channel, encode(message)};
}

inline image_t picture_message(const cv::Mat& image) {
  image_t m{};
  m.width_px = image.cols;
  m.height_px = image.rows;
  m.format = image_t::FORMAT_PNG;
  cv::imencode(".png", image, m.data);
  m.size_bytes = static_cast<int32_t>(m.data.size());
  return m;
}

class Collector final : public MessageSink {
 public:
  void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
    messages[channel].emplace_back(bytes.begin(), bytes.end());
  }
  template <class T>
  [[nodiscard]] std::vector<T> all(const std::string& channel) const {
    std::vector<T> out;
    if (messages.contains(channel)) {
      for (const auto& bytes : messages.at(channel)) out.push_back(decode<T>(bytes));
    }
    return out;
  }
  std::map<std::string, std::vector<std::vector<uint8_t>>> messages;
};

inline void feed(StageRunner& runner, const Sent& message) {
  const auto& inputs = runner.spec().inputs;
  for (size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i].channel == message.channel) runner.offer(static_cast<int>(i), message.bytes);
  }
}

}  // namespace roadfix::test
