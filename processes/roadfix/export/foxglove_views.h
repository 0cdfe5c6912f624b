/// What viewers draw of our messages, as foxglove.* messages. No view: what a message has nothing to draw of (an
/// invalid pose, a fix that is none) gives nothing.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <roadfix/config_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/health_t.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/ledger_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/vo_features_t.hpp>

#include "geodesy/enu_anchor.h"
#include "roadfix/export/protobuf_message.h"

namespace roadfix {

/// A foxglove message and where it goes: `topic` behind the channel's own name, or alone where it begins with '/'.
struct FoxgloveView {
  const char* schema;  ///< without "foxglove."
  std::string topic;
  ProtobufMessage message;
};
using FoxgloveViews = std::vector<FoxgloveView>;

/// Frames: `enu`, at the first anchor that any pose has; `local/CHANNEL` of a pose without one; `vehicle` under the
/// channel of `vehicle_channel`, the channel's name under every other; cameras and the IMU under `vehicle`.
class FoxgloveViewer {
 public:
  explicit FoxgloveViewer(std::string vehicle_channel) : vehicle_channel_(std::move(vehicle_channel)) {}

  FoxgloveViews views(const std::string& channel, const pose_t& pose);
  FoxgloveViews views(const std::string& channel, const gnss_t& fix) const;
  FoxgloveViews views(const std::string& channel, const image_t& image) const;
  FoxgloveViews views(const std::string& channel, const vo_features_t& features);
  FoxgloveViews views(const std::string& channel, const health_t& health);
  FoxgloveViews views(const std::string& channel, const ledger_t& ledger);
  /// Cameras and their places, once for each calibration.
  FoxgloveViews views(const std::string& channel, const config_t& config);

 private:
  std::string vehicle_channel_;
  std::optional<Geodetic> anchor_;
  std::map<int64_t, std::pair<float, float>> last_points_;
  std::optional<int8_t> last_verdict_;
  std::map<std::string, std::pair<int64_t, int64_t>> last_entries_;  ///< run and entry, by channel
  std::string last_calibration_;
};

}  // namespace roadfix
