/// Update of the yaw by the magnetic heading (MODEL.md, section 9).
#pragma once

#include <optional>

#include "samples/samples.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_report.h"
#include "wheel/wheel_state.h"

namespace roadfix {

class HeadingUpdate {
 public:
  explicit HeadingUpdate(const WheelConfig& config) : config_(config) {}

  /// `yaw_rate`: rad/s, between the state's time and the sample's; `standing`: yaw is constant.
  WheelInputStatus update(WheelState& state, const MagSample& mag, double yaw_rate, bool standing);

  template <class Archive>
  void serialise(Archive& a) {
    a(last_us_, strength_, dip_);
  }

 private:
  [[nodiscard]] bool due(int64_t t_us, bool standing) const;

  WheelConfig config_;
  std::optional<int64_t> last_us_;  ///< of the last heading used
  double strength_ = 0.0;           ///< T, at the first heading
  double dip_ = 0.0;                ///< rad, likewise
};

}  // namespace roadfix
