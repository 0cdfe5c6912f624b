/// The dashboard's eyes: collects what the page shows and makes a frame of it, a few a second.
#pragma once

#include <map>
#include <optional>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_status_t.hpp>
#include <string>

#include "monitor/handler.h"
#include "monitor/web/board.h"

namespace roadfix {

class DriveView : public MonitorListener {
 public:
  /// Both must outlive it. `rate_hz`: frames per second, at most that of the decisions. `bytes_stay`: a log's messages
  /// stay where they are and need no copy.
  /// `camera`: the channel whose pictures are shown; empty: CAMERA_LEFT, or another one as long as that does not arrive.
  DriveView(Board& board, Health& health, double rate_hz, bool bytes_stay, const std::string& camera = "");

  void message(const std::string& channel, const std::string& type, const BusMessage& message, int64_t now_us) override;
  void decided(const HealthReport& report, bool changed) override;

  /// JSON of this moment.
  [[nodiscard]] std::string frame(const HealthReport& report);

 private:
  /// Where a frame of an estimator's own lies in ENU: laid on the judged estimate when it began, and left there, so
  /// that its drift shows.
  struct Pin {
    int segment = -1;
    SE3 T_enu_local;
  };
  /// One estimate on the map.
  struct Placed {
    SE3 T_enu_vehicle;
    Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();
    bool pinned = false;
  };

  void pin(const PoseMonitor& monitor, const std::string& judged);
  [[nodiscard]] std::optional<Placed> placed(const PoseMonitor& monitor) const;
  [[nodiscard]] std::optional<Eigen::Vector2d> error(const PoseMonitor& monitor) const;  ///< m horizontal, rad
  void keep_picture(const BusMessage& message);
  [[nodiscard]] History::Row history_row(const HealthReport& report) const;

  Board& board_;
  Health& health_;
  int64_t period_us_;
  bool bytes_stay_;
  bool chosen_;         ///< the camera is, by the configuration
  std::string camera_;  ///< whose pictures are shown
  int64_t framed_us_ = 0;
  std::map<std::string, Pin> pins_;
  PoseMonitor reference_;
  std::optional<fusion_state2_t> fusion_;
  std::optional<vo_status_t> vo_status_;
  std::optional<vo_features2_t> features_;
  std::optional<ins_status_t> ins_status_;
  std::optional<gnss_t> gnss_;
  int64_t picture_utime_ = 0;
};

}  // namespace roadfix
