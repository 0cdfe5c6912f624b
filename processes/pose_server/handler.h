/// Poses in, NMEA sentences out, each at its rate. No I/O and no clock: time arrives with the messages and with
/// advance(), so that a log gives the same sentences each time.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>

#include "bus/bus.h"
#include "bus/types/schema.h"
#include "pose_server/nmea_pose.h"
#include "pose_server/pose_server_config.h"

namespace roadfix {

class PoseServerHandler {
 public:
  /// `geoid` may be null; it outlives the handler.
  PoseServerHandler(const PoseServerConfig& config, const GeoidModel* geoid);

  /// What is due with this message: sentences, often none. `now_us`: of arrival, in the run's time.
  std::string take(const BusMessage& message, int64_t now_us);

  /// What is due where no pose came for too long: sentences without a position.
  std::string advance(int64_t now_us);

  [[nodiscard]] int64_t poses() const { return poses_; }
  [[nodiscard]] int64_t refused() const { return refused_; }  ///< undecodable, or not newer than the one before
  /// As text; empty where positions go out.
  [[nodiscard]] const std::string& state_reason() const { return state_reason_; }

 private:
  static constexpr std::size_t kSentences = 6;
  struct Input {
    MessageCheck check;
    void (PoseServerHandler::*take)(std::span<const uint8_t>);
  };

  void take_pose(std::span<const uint8_t> bytes);
  void take_gnss(std::span<const uint8_t> bytes);
  void take_aiding(std::span<const uint8_t> bytes);
  [[nodiscard]] FixFacts fix_at(int64_t t_us) const;
  std::string due(const NmeaPose& pose);

  PoseServerConfig config_;
  const GeoidModel* geoid_;
  std::map<std::string, Input, std::less<>> inputs_;
  std::array<int64_t, kSentences> periods_us_{};  ///< 0: never
  std::array<std::optional<int64_t>, kSentences> slots_{};
  std::optional<FixFacts> fix_;
  int64_t fix_us_ = 0;                  ///< of fix_
  std::optional<int64_t> accepted_us_;  ///< of the newest fix whose position an estimator took
  bool aiding_received_ = false;
  std::optional<int64_t> pose_us_;     ///< utime of the newest pose
  std::optional<int64_t> arrived_us_;  ///< when it came; before the first pose: when time began
  int64_t now_us_ = 0;
  std::string out_, state_reason_ = "no pose yet";
  int64_t poses_ = 0, refused_ = 0;
};

}  // namespace roadfix
