/// A simulated drive with tracks in place of pictures as the messages that a car's drivers and tracker publish.
#pragma once

#include <map>
#include <roadfix/vo_features2_t.hpp>

#include "bus/sample_codec.h"
#include "bus/track_codec.h"
#include "support/small_drive.h"
#include "support/track_drive.h"

namespace roadfix::test {

struct TrackNoiseSaid {
  double sigma_px = 0.1, walk_px = 0.15, right_sigma_px = 0.2;
};

inline vo_features2_t to_message(const TrackFrame& frame, const TrackNoiseSaid& noise, size_t most) {
  vo_features2_t m{};
  m.utime = frame.t_us;
  for (const TrackObservation& o : frame.tracks) {
    if (m.track_id.size() == most) break;
    append({o.id, o.left, o.right, noise.sigma_px, noise.walk_px, noise.right_sigma_px}, vo_features2_t::USE_MATCHED,
           m);
  }
  return m;
}

/// In the order of their stamps; pictures show at most `most_tracks`.
inline std::vector<DriveMessage> track_messages(const TrackDrive& drive, size_t most_tracks) {
  std::vector<DriveMessage> all;
  std::map<std::string, int64_t> seq;
  const auto put = [&](const char* channel, const auto& message) {
    all.push_back(drive_message(channel, message.utime, seq[channel]++, message));
  };
  for (const DriveEvent& event : drive.events) {
    if (const auto* imu = std::get_if<ImuSample>(&event)) put("IMU", roadfix::to_message(*imu));
    if (const auto* fix = std::get_if<GnssFix>(&event)) put("GNSS", roadfix::to_message(*fix));
    if (const auto* wheels = std::get_if<WheelSample>(&event)) put("WHEELS", roadfix::to_message(*wheels));
    if (const auto* mag = std::get_if<MagSample>(&event)) put("MAG", roadfix::to_message(*mag));
    if (const auto* frame = std::get_if<TrackFrame>(&event)) put("VO_FEATURES", to_message(*frame, {}, most_tracks));
  }
  return all;
}

}  // namespace roadfix::test
