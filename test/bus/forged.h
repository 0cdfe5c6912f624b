/// False messages for every channel of the stack: of another type, of a wrong size, of a time that cannot be.
#pragma once

#include <limits>
#include <random>
#include <roadfix/aiding_t.hpp>
#include <roadfix/config_t.hpp>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/health_t.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/horizon_t.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/ledger_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/raw_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_restart_t.hpp>
#include <roadfix/vo_status_t.hpp>
#include <roadfix/wheels_t.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bus/types/message.h"

namespace roadfix::test {

struct Forged {
  std::string channel;
  std::vector<uint8_t> bytes;
  bool stamped = false;  ///< its utime counts from the beginning of the drive
};

template <class T>
std::vector<uint8_t> stamped_with(int64_t utime) {
  T message{};
  message.utime = utime;
  message.run = 1;
  return encode(message);
}

template <class T>
void forge(const std::string& channel, std::mt19937& random, std::vector<Forged>& out) {
  const auto add = [&](std::vector<uint8_t> bytes) { out.push_back({channel, std::move(bytes), false}); };
  const std::vector<uint8_t> whole = stamped_with<T>(1);
  add({});
  add(std::vector<uint8_t>(whole.begin(), whole.begin() + 7));
  add(std::vector<uint8_t>(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2)));
  add(std::vector<uint8_t>(whole.begin(), whole.end() - 1));
  std::vector<uint8_t> longer = whole;
  longer.resize(whole.size() + 1000);
  add(std::move(longer));
  std::vector<uint8_t> lengths = whole;  // every count in it is 0x7f7f7f7f
  std::fill(lengths.begin() + 32, lengths.end(), uint8_t{0x7f});
  add(std::move(lengths));
  std::vector<uint8_t> noise(whole.size());
  for (uint8_t& byte : noise) byte = static_cast<uint8_t>(random());
  add(std::move(noise));
  raw_t other{};  // nobody of the stack takes it
  other.data.resize(200);
  other.size_bytes = 200;
  add(encode(other));
  constexpr int64_t kHour_us = 3'600'000'000;
  for (const int64_t utime :
       {int64_t{0}, int64_t{-1}, std::numeric_limits<int64_t>::max(), std::numeric_limits<int64_t>::min(),
        int64_t{4'000'000'000'000'000}, int64_t{1'000'000'000'000'000}}) {
    add(stamped_with<T>(utime));
  }
  out.push_back({channel, stamped_with<T>(kHour_us), true});
  out.push_back({channel, stamped_with<T>(-kHour_us), true});
}

inline std::vector<Forged> forged_messages(std::mt19937& random) {
  std::vector<Forged> all;
  forge<imu_t>("IMU", random, all);
  forge<gnss_t>("GNSS", random, all);
  forge<wheels_t>("WHEELS", random, all);
  forge<mag_t>("MAG", random, all);
  for (const char* channel : {"CAMERA_LEFT", "CAMERA_RIGHT"}) forge<image_t>(channel, random, all);
  for (const char* channel : {"POSE_INS", "POSE_VO", "POSE_VO_MAP", "POSE_WHEEL", "POSE_FUSED", "POSE_LOCAL"}) {
    forge<pose_t>(channel, random, all);
  }
  forge<ins_status_t>("INS_STATUS", random, all);
  forge<vo_status_t>("VO_STATUS", random, all);
  forge<vo_features2_t>("VO_FEATURES", random, all);
  forge<vo_restart_t>("VO_RESTART", random, all);
  forge<fusion_state2_t>("FUSION_STATE", random, all);
  for (const char* channel : {"AIDING_INS", "AIDING_FUSION"}) forge<aiding_t>(channel, random, all);
  forge<health_t>("HEALTH", random, all);
  forge<heartbeat_t>("HEARTBEAT_RECORDER", random, all);
  for (const char* stage : {"GNSS_INS_EKF", "WHEEL_ODOMETRY", "VO_TRACKER", "IMM_FUSION"}) {
    const std::string name = stage;
    forge<heartbeat_t>("HEARTBEAT_" + name, random, all);
    forge<ledger_t>("LEDGER_" + name, random, all);
    forge<state_t>("STATE_" + name, random, all);
    forge<state_t>("START_" + name, random, all);
    forge<horizon_t>("HORIZON_" + name, random, all);
    forge<config_t>("CONFIG_" + name, random, all);
  }
  return all;
}

}  // namespace roadfix::test
