#include "pose_server/handler.h"

#include <fmt/format.h>

#include <cmath>
#include <roadfix/aiding_t.hpp>
#include <roadfix/gnss_t.hpp>

#include "bus/types/message.h"

namespace roadfix {

namespace {

using Write = std::string (*)(const NmeaPose&, const std::string&);
/// Time that goes back by more than this: a stage started again, or another drive is played.
constexpr int64_t kAnotherDrive_us = 10'000'000;
constexpr std::array<Write, 6> kWriters = {write_gga, write_rmc, write_vtg, write_hdt, write_gst, write_zda};

int64_t microseconds(double seconds) { return std::llround(seconds * 1e6); }

int64_t period_us(double rate_hz) { return rate_hz > 0.0 ? std::max<int64_t>(microseconds(1.0 / rate_hz), 1) : 0; }

FixType fix_type(int8_t code) {
  constexpr std::array<FixType, 6> kTypes = {FixType::kNone,     FixType::kSingle,   FixType::kDifferential,
                                             FixType::kRtkFloat, FixType::kRtkFixed, FixType::kDeadReckoning};
  return code >= 0 && static_cast<std::size_t>(code) < kTypes.size() ? kTypes[static_cast<std::size_t>(code)]
                                                                     : FixType::kNone;
}

HeightKind height_kind(int8_t code) {
  if (code == gnss_t::HEIGHT_ELLIPSOID) return HeightKind::kEllipsoid;
  return code == gnss_t::HEIGHT_MSL ? HeightKind::kMeanSeaLevel : HeightKind::kUnknown;
}

}  // namespace

PoseServerHandler::PoseServerHandler(const PoseServerConfig& config, const GeoidModel* geoid)
    : config_(config), geoid_(geoid) {
  const Schema& schema = Schema::built_in();
  inputs_[config.gnss_channel] = {schema.check_of("gnss_t"), &PoseServerHandler::take_gnss};
  inputs_[config.aiding_channel] = {schema.check_of("aiding_t"), &PoseServerHandler::take_aiding};
  inputs_[config.pose_channel] = {schema.check_of("pose_t"), &PoseServerHandler::take_pose};
  const SentenceRates& r = config.rates;
  const std::array<double, kSentences> rates = {r.gga, r.rmc, r.vtg, r.hdt, r.gst, r.zda};
  for (std::size_t i = 0; i < kSentences; ++i) periods_us_[i] = period_us(rates[i]);
}

std::string PoseServerHandler::take(const BusMessage& message, int64_t now_us) {
  const auto input = inputs_.find(message.channel);
  // The pose that ends a silence is sent, not the silence.
  if (message.channel == config_.pose_channel) {
    now_us_ = now_us;
  } else {
    out_ = advance(now_us);
  }
  if (input == inputs_.end()) return std::move(out_);
  if (input->second.check(message.bytes) != CheckResult::kOk || !is_plausible(*read_header(message.bytes))) {
    ++refused_;
    return std::move(out_);
  }
  (this->*input->second.take)(message.bytes);
  return std::move(out_);
}

void PoseServerHandler::take_gnss(std::span<const uint8_t> bytes) {
  const auto m = decode<gnss_t>(bytes);
  const FixType type = fix_type(m.fix_type);
  if (type == FixType::kNone) return;
  fix_us_ = m.utime;
  fix_ = FixFacts{quality_of(type), height_kind(m.height_kind), {}, {}};
  if (m.has_num_satellites != 0) fix_->num_satellites = m.num_satellites;
  if (m.has_correction_age != 0) fix_->correction_age_s = m.correction_age_s;
}

void PoseServerHandler::take_aiding(std::span<const uint8_t> bytes) {
  const auto m = decode<aiding_t>(bytes);
  aiding_received_ = true;
  if (m.source != aiding_t::SOURCE_GNSS_POSITION) return;
  if (m.status == aiding_t::STATUS_ACCEPTED || m.status == aiding_t::STATUS_RESET) accepted_us_ = m.measurement_utime;
}

/// Where an estimator publishes which fixes it took, a fix that it did not take is none.
FixFacts PoseServerHandler::fix_at(int64_t t_us) const {
  FixFacts facts;
  if (fix_) facts.height_kind = fix_->height_kind;  // heights stay of their kind when the fixes stop
  const int64_t oldest_us = t_us - microseconds(config_.fix_age);
  if (!fix_ || fix_us_ < oldest_us) return facts;
  if (aiding_received_ && (!accepted_us_ || *accepted_us_ < oldest_us)) return facts;
  return *fix_;
}

void PoseServerHandler::take_pose(std::span<const uint8_t> bytes) {
  const auto m = decode<pose_t>(bytes);
  if (pose_us_ && m.utime <= *pose_us_ && *pose_us_ - m.utime < kAnotherDrive_us) {
    ++refused_;
    return;
  }
  ++poses_;
  pose_us_ = m.utime;
  arrived_us_ = now_us_;
  const NmeaPose pose = nmea_pose(m, fix_at(m.utime), config_.point, geoid_);
  state_reason_ = pose.quality != NmeaQuality::kNone
                      ? ""
                      : config_.pose_channel + " gives no position: " + (m.reason.empty() ? "not in ENU" : m.reason);
  out_ += due(pose);
}

std::string PoseServerHandler::advance(int64_t now_us) {
  now_us_ = now_us;
  if (!arrived_us_) arrived_us_ = now_us;
  const int64_t silent_us = now_us - *arrived_us_;
  if (silent_us < microseconds(config_.silence)) return {};
  state_reason_ =
      config_.pose_channel +
      (pose_us_ ? fmt::format(" is silent for {:.1f} s", static_cast<double>(silent_us) * 1e-6) : " was never heard");
  NmeaPose nothing;
  nothing.t_us = pose_us_ ? *pose_us_ + silent_us : now_us;
  return due(nothing);
}

std::string PoseServerHandler::due(const NmeaPose& pose) {
  std::string text;
  for (std::size_t i = 0; i < kSentences; ++i) {
    if (periods_us_[i] == 0) continue;
    const int64_t slot = pose.t_us / periods_us_[i];
    if (slots_[i] && slot <= *slots_[i] && (*slots_[i] - slot) * periods_us_[i] < kAnotherDrive_us) continue;
    slots_[i] = slot;
    text += kWriters[i](pose, config_.talker);
  }
  return text;
}

}  // namespace roadfix
