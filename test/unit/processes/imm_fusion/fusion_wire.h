/// Streams of the fusion's tests as messages, and a stage of imm_fusion that takes them.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/vo_status_t.hpp>
#include <string>
#include <vector>

#include "bus/run/stage_runner.h"
#include "bus/sample_codec.h"
#include "imm_fusion/handler.h"
#include "unit/fusion/streams.h"

namespace roadfix::test {

struct Arrival {
  int64_t at_us = 0;
  std::string channel;
  Header header;
  std::vector<uint8_t> bytes;
};

inline constexpr double kAnchor_deg[] = {37.5, 127.0};

/// Messages in the order of arrival; all but POSE_INS late by up to `late_us`.
class Wire {
 public:
  explicit Wire(int64_t late_us = 0, int64_t run = 1) : late_us_(late_us), run_(run) {
    status_.scale_source = vo_status_t::SCALE_FROM_STEREO;
  }

  template <class T>
  void put(const std::string& channel, int64_t t_us, T message) {
    message.utime = t_us;
    message.run = run_;
    message.seq = seq_[channel]++;
    const int64_t late = channel == "POSE_INS" ? 0 : message.seq % 4 * late_us_ / 3;
    messages_.push_back({t_us + late, channel, {t_us, run_, message.seq}, encode(message)});
  }

  void put(const StreamEvent& e) {
    const Odometry& o = e.sample.odometry;
    pose_t m{};
    fill_pose(o, m);
    m.scale = pose_t::SCALE_METRIC;
    m.frame = pose_t::FRAME_LOCAL;
    if (e.sample.channel == FusionChannel::kVo) {
      put("VO_STATUS", o.t_us, status_);
      return put("POSE_VO", o.t_us, m);
    }
    if (e.sample.channel == FusionChannel::kWheel) return put("POSE_WHEEL", o.t_us, m);
    m.frame = pose_t::FRAME_ENU;
    m.anchor_lat_deg = kAnchor_deg[0];
    m.anchor_lon_deg = kAnchor_deg[1];
    put("POSE_INS", o.t_us, m);
    if (o.t_us % 200'000 != 0) return;
    ins_status_t status{};
    status.aided_by = e.gnss ? ins_status_t::AIDED_GNSS_POSITION : 0;
    put("INS_STATUS", o.t_us, status);
  }

  [[nodiscard]] std::vector<Arrival> take() {
    std::stable_sort(messages_.begin(), messages_.end(),
                     [](const Arrival& a, const Arrival& b) { return a.at_us < b.at_us; });
    return std::move(messages_);
  }

 private:
  int64_t late_us_;
  int64_t run_;
  vo_status_t status_{};
  std::map<std::string, int64_t> seq_;
  std::vector<Arrival> messages_;
};

struct Caught final : MessageSink {
  std::map<std::string, std::vector<std::vector<uint8_t>>> messages;
  void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
    messages[channel].emplace_back(bytes.begin(), bytes.end());
  }
  template <class T>
  [[nodiscard]] std::vector<T> all(const std::string& channel) const {
    std::vector<T> decoded;
    const auto found = messages.find(channel);
    if (found == messages.end()) return decoded;
    for (const auto& bytes : found->second) decoded.push_back(decode<T>(bytes));
    return decoded;
  }
};

inline void offer(StageRunner& runner, const Arrival& a) {
  const auto& inputs = runner.spec().inputs;
  const auto its =
      std::find_if(inputs.begin(), inputs.end(), [&](const InputSpec& i) { return i.channel == a.channel; });
  REQUIRE(its != inputs.end());
  runner.offer(static_cast<int>(its - inputs.begin()), a.bytes);
}

inline Caught run(const std::vector<Arrival>& messages, const ImmFusionConfig& config = {}) {
  Caught sink;
  StageRunner runner(make_imm_fusion(Calibration{}, config), sink);
  for (const Arrival& a : messages) offer(runner, a);
  return sink;
}

}  // namespace roadfix::test
