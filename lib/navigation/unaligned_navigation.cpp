#include "navigation/unaligned_navigation.h"

#include <stdexcept>
#include <utility>

#include "navigation/initialisation/local_start.h"
#include "navigation/navigation.h"

namespace roadfix::navigation {

namespace {

constexpr char kReason[] = "a local frame, until the heading is known";

}  // namespace

void UnalignedNavigation::begin(const NavigationConfig& config) {
  if (!config.sources.camera || !config.facts.camera || !config.facts.has_imu || !config.sources.any_gnss()) return;
  filter_ = std::make_unique<Navigation>(without_gnss(config));
  spoken_ = false;
}

void UnalignedNavigation::see(const ImuSample& imu) {
  if (runs()) (void)filter_->see(imu);
}

void UnalignedNavigation::advance(const ImuSample& imu) {
  if (runs()) (void)filter_->advance(imu);
}

void UnalignedNavigation::add(const WheelSample& wheels, int64_t id) {
  if (runs()) filter_->add(wheels, id);
}

void UnalignedNavigation::add(const TrackPicture& picture, int64_t id) {
  if (!runs()) return;
  camera_sees_ = camera_sees_ || !picture.tracks.empty();
  filter_->add(picture, id);
}

void UnalignedNavigation::clear_records() {
  if (runs()) filter_->clear_records();
}

NavigationOutput UnalignedNavigation::speak_for(NavigationOutput own, PoseResets& resets) {
  NavigationOutput local = filter_->output();
  if (local.odometry.validity == Validity::kInvalid || !camera_sees_) return own;
  resets.resume(local.imu.T_frame_vehicle);
  spoken_ = true;
  local.phase = own.phase;
  if (local.reason.empty()) local.reason = kReason;
  if (local.reset_counter == 0) local.reset_delta = resets.published_delta(filter_->filter()->state().x);
  local.reset_counter += resets.counter();
  return local;
}

void UnalignedNavigation::end(const SE3& T_level_imu, PoseResets& resets) {
  if (spoken_) {
    const NavigationOutput last = filter_->output();
    resets.go_on(last.reset_counter);
    resets.count(last.imu.T_frame_vehicle, T_level_imu);
  }
  filter_.reset();
}

std::vector<uint8_t> UnalignedNavigation::saved() const { return runs() ? filter_->save() : std::vector<uint8_t>(); }

void UnalignedNavigation::load(const std::vector<uint8_t>& state) {
  if (state.empty()) return filter_.reset();
  if (!runs()) throw std::runtime_error("state: of a filter in a local frame, which this configuration has not");
  filter_->load(state);
}

}  // namespace roadfix::navigation
