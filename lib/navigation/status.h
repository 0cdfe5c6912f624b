/// What is said of the estimate: whether its pose is valid, what it waits for, what aids it.
#pragma once

#include <string>

#include "navigation/initialisation/initialisation.h"
#include "navigation/measurement_input.h"

namespace roadfix::navigation {

struct NavigationStatus {
  Phase phase = Phase::kWaiting;
  std::string waits_for;  ///< plain words; empty once aligned
  int aided_by = 0;       ///< bit i: AidingSource i used within its last coasting time
  bool coasting = false;
  int64_t coasting_since_us = 0;
  GnssQuality gnss_quality = GnssQuality::kAbsent;
  std::string gnss_reason;
  int64_t bad_imu_samples = 0;
  bool imu_frozen = false;
  int64_t imu_gaps = 0;
  int64_t wheel_scale_steps = 0;  ///< that were detected and taken back
};

struct NavigationOutput {
  Phase phase = Phase::kWaiting;
  bool local = false;  ///< the level frame is where it started, until fixes tie it; else enu
  Odometry odometry;   ///< of the vehicle's axes, origin at the imu, in the level frame
  Odometry imu;        ///< the same of the imu's axes
  std::string reason;  ///< plain words, empty when all is well
  int reset_counter = 0;
  SE3 reset_delta;  ///< of the last jump of odometry: p new minus old; q_old^-1 q_new
};

/// Reads the parts of a Navigation, which must outlive it; has no state.
class StatusReport {
 public:
  StatusReport(const NavigationConfig& config, const MotionInput& motion, const MeasurementInput& measurements,
               const LevelFrame& frame, const Initialisation& start, const Aiding& aiding, const AidingLog& log)
      : config_(config),
        motion_(motion),
        measurements_(measurements),
        frame_(frame),
        start_(start),
        aiding_(aiding),
        log_(log) {}

  /// Plain words; empty once aligned.
  [[nodiscard]] const char* waits_for() const;
  /// Sets validity and reason of an odometry whose numbers are there.
  void judge(NavigationOutput& out) const;
  /// `filter`: in use, null where there is none.
  [[nodiscard]] NavigationStatus status(const Filter* filter) const;

 private:
  [[nodiscard]] std::optional<int64_t> coasting_since() const;
  /// s without aiding that are no coasting yet: a receiver that gives a fix every five seconds is not silent for those.
  [[nodiscard]] double coasting_time() const;

  const NavigationConfig& config_;
  const MotionInput& motion_;
  const MeasurementInput& measurements_;
  const LevelFrame& frame_;
  const Initialisation& start_;
  const Aiding& aiding_;
  const AidingLog& log_;
};

}  // namespace roadfix::navigation
