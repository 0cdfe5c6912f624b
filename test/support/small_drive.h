/// A short drive of made-up sensor messages, as bytes: for tests of ordering and replay, not of estimation.
#pragma once

#include <random>
#include <roadfix/config_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/log/log_writer.h"
#include "bus/types/message.h"

namespace roadfix::test {

struct DriveMessage {
  std::string channel;
  Header header;
  std::vector<uint8_t> bytes;
};

constexpr int64_t kDriveStart_us = 1'700'000'000'000'000;

template <class T>
DriveMessage drive_message(const std::string& channel, int64_t utime, int64_t seq, T message) {
  message.utime = utime;
  message.run = kDriveStart_us;
  message.seq = seq;
  return {channel, {utime, kDriveStart_us, seq}, encode(message)};
}

/// IMU at 100 Hz, WHEELS at 50 Hz, GNSS at 4 Hz, REFERENCE at 10 Hz, one CONFIG_DRIVE; in the order of utime.
inline std::vector<DriveMessage> small_drive(double seconds, unsigned seed = 1) {
  std::mt19937 random(seed);
  const auto value = [&] { return static_cast<double>(random()) * 1e-9; };
  std::vector<DriveMessage> drive;
  config_t config{};
  config.process = "drive";
  config.config_yaml = "name: small\n";
  drive.push_back(drive_message("CONFIG_DRIVE", kDriveStart_us, 0, config));
  const auto samples = static_cast<int64_t>(seconds * 100.0);
  for (int64_t i = 0; i < samples; ++i) {
    const int64_t utime = kDriveStart_us + i * 10'000;
    imu_t imu{};
    imu.gyro_radps[0] = value();
    drive.push_back(drive_message("IMU", utime, i, imu));
    if (i % 2 == 0) {
      wheels_t wheels{};
      wheels.num_speeds = 1;
      wheels.speed_mps[0] = value();
      drive.push_back(drive_message("WHEELS", utime, i / 2, wheels));
    }
    if (i % 25 == 0) {
      gnss_t gnss{};
      gnss.height_m = value();
      drive.push_back(drive_message("GNSS", utime, i / 25, gnss));
    }
    if (i % 10 == 0) drive.push_back(drive_message("REFERENCE", utime, i / 10, pose_t{}));
  }
  return drive;
}

inline void write_drive(const std::filesystem::path& path, const std::vector<DriveMessage>& drive) {
  LogWriter writer(path);
  for (const DriveMessage& message : drive) writer.write(message.channel, message.header.utime, message.bytes);
  writer.commit();
}

}  // namespace roadfix::test
