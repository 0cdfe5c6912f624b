/// Until the heading is known: a filter without the receiver, begun in a local frame beside the one that seeks the heading.
/// Its pose goes out meanwhile, and one reset leads from it into the other's (MODEL.md, section 7, "Until the heading is known").
#pragma once

#include <memory>

#include "navigation/config.h"
#include "navigation/output_predictor.h"
#include "navigation/pose_resets.h"
#include "navigation/status.h"

namespace roadfix::navigation {

class Navigation;

class UnalignedNavigation {
 public:
  /// Anew; nothing where there is no camera, no imu or no receiver.
  void begin(const NavigationConfig& config);
  [[nodiscard]] bool runs() const { return filter_ != nullptr; }

  void see(const ImuSample& imu);
  void advance(const ImuSample& imu);
  void add(const WheelSample& wheels, int64_t id);
  void add(const TrackPicture& picture, int64_t id);
  void clear_records();

  /// Wants runs(). In place of `own`, which is invalid; that one as it is where this one has no pose either, or no picture
  /// had tracks yet. `resets` are the other's.
  [[nodiscard]] NavigationOutput speak_for(NavigationOutput own, PoseResets& resets);
  /// Wants runs(). T_level_imu is the other's, which speaks from now on.
  void end(const SE3& T_level_imu, PoseResets& resets);

  template <class Archive>
  void serialise(Archive& a) {
    std::vector<uint8_t> state;
    if constexpr (!Archive::kReads) state = saved();
    a(state, spoken_, camera_sees_);
    if constexpr (Archive::kReads) load(state);
  }

 private:
  [[nodiscard]] std::vector<uint8_t> saved() const;  ///< empty where nothing runs
  void load(const std::vector<uint8_t>& state);

  std::unique_ptr<Navigation> filter_;
  bool spoken_ = false;
  bool camera_sees_ = false;  ///< a picture had tracks: a camera that sees nothing changes no pose
};

}  // namespace roadfix::navigation
