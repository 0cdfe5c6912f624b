/// The navigation filter: one error state and one covariance for GNSS, imu, wheels and camera. Derivation:
/// lib/navigation/MODEL.md.
///
/// Frames: level is enu at the first good fix (or at the remembered place), or local where no fix has come: it becomes enu,
/// with a reset, when fixes tell how it lies in it. imu axes x forward, y left, z up; vehicle axes differ from the imu's by
/// the mounting angles, which are estimated. What goes out is of the vehicle's axes, and of the imu's beside it.
/// Time: inputs come in the order of their stamps as the caller's horizon passes them (advance, add); see() hands in
/// the newest imu sample ahead of the horizon, and output() is for that one. The state stays behind the horizon by the
/// longest latency that is possible yet, so that every measurement is used at its own moment.
/// Without an imu the car's own motion drives the state (motion/car_motion.h): see() of wheel samples, or of the time
/// alone, and add() take the place of see() and advance() of imu samples, and imu axes are the vehicle's. It begins so
/// where see() is called before the first imu sample; with that one it begins again.
/// Guarantees: same inputs in the same order give the same bits; no allocation once aligned; one thread.
#pragma once

#include <span>

#include "navigation/output_predictor.h"
#include "navigation/pose_resets.h"
#include "navigation/status.h"
#include "navigation/unaligned_navigation.h"

namespace roadfix::navigation {

class Navigation {
 public:
  explicit Navigation(const NavigationConfig& config);

  InputStatus see(const ImuSample& imu);       ///< newest sample, ahead of the horizon
  InputStatus advance(const ImuSample& imu);   ///< the horizon has passed this sample
  InputStatus see(const WheelSample& wheels);  ///< newest sample, where no imu is; the first must have a yaw rate
  InputStatus see(int64_t t_us);               ///< newest time, where such wheels have fallen silent
  [[nodiscard]] bool has_imu() const { return config_.facts.has_imu; }
  void add(const GnssFix& fix, int64_t id = 0);
  void add(const WheelSample& wheels, int64_t id = 0);
  void add(const MagSample& mag, int64_t id = 0);
  void add(const TrackPicture& picture, int64_t id = 0);
  /// Used as soon as there is a state; of a local frame it makes enu at once.
  void add(const PriorPose& told, int64_t id = 0);

  /// Of enu; nothing before the first fix, and in a local frame that fixes have to tie.
  [[nodiscard]] std::optional<Geodetic> anchor() const { return frame_.anchor(); }
  /// What an earlier drive left, before the first start of this one; later it changes nothing.
  void recall(const Memory& memory);
  /// What this drive leaves to the next; nothing until aligned.
  [[nodiscard]] std::optional<Memory> memory() const;

  /// Until fixes have told the heading, where a camera is: in a local frame.
  [[nodiscard]] NavigationOutput output();
  [[nodiscard]] NavigationStatus status() const { return report().status(filter()); }
  /// Filter in use (the leading hypothesis while aligning); nothing before alignment starts.
  [[nodiscard]] const Filter* filter() const;
  /// Nothing where no camera is used.
  [[nodiscard]] const CameraControl* camera() const { return aiding_.camera(); }
  /// What was tried since the last call to clear_records().
  [[nodiscard]] const std::vector<AidingRecord>& records() const { return log_.records(); }
  void clear_records();

  /// Everything that later outputs depend on; load() throws std::runtime_error on bytes that are no such state.
  [[nodiscard]] std::vector<uint8_t> save() const;
  void load(std::span<const uint8_t> bytes);

 private:
  Navigation(const NavigationConfig& config, bool has_imu);
  [[nodiscard]] bool goes_without_imu();
  void change_motion(bool has_imu);
  void take(const GnssFix& fix, int64_t id);
  void take(const WheelSample& wheels, int64_t id);

  void advance_to(int64_t horizon_us);
  void step(const MotionInput::Step& now);
  void initialise(const MotionInput::Step& now);
  /// While the heading is sought: every hypothesis.
  void align(const MotionInput::Step& now);
  /// The filter that runs.
  void update(const MotionInput::Step& now);
  void use(const Queued& q);
  bool tie_frame(const Queued& q);
  void use_prior_pose();
  void predict_output();
  [[nodiscard]] NavigationOutput own_output();

  void run_leader();
  void begin_running();
  void begin_again();
  void seek_heading();
  void drop_filter();
  void forget_before(int64_t t_us);
  [[nodiscard]] inertial::ImuNoise noise_over(int64_t t_us, double dt) const;
  [[nodiscard]] StatusReport report() const { return {config_, motion_, measurements_, frame_, start_, aiding_, log_}; }
  template <class Archive>
  void serialise(Archive& a);

  NavigationConfig given_, config_;  ///< the second as it is used, with or without an imu
  MotionInput motion_;
  MeasurementInput measurements_;
  LevelFrame frame_;
  Initialisation start_;
  Aiding aiding_;
  AidingLog log_;
  std::optional<Filter> filter_;  ///< that runs
  OutputPredictor output_;
  PoseResets resets_;
  UnalignedNavigation unaligned_;  ///< speaks while this one seeks the heading
};

}  // namespace roadfix::navigation
