#include "support/track_drive.h"

#include <algorithm>
#include <map>

#include "simulation/sensors.h"

namespace roadfix::test {
namespace {

/// What the rig saw at each exposure, whether it arrived or not.
std::vector<std::vector<TrackObservation>> observe_all(const TrackDrive& d, const TrackConfig& config) {
  const World world = world_of(d.drive);
  std::optional<TrackSimulator::RightCamera> right;
  if (d.drive.config.camera.layout == CameraLayout::kStereo) right = {d.rig.camera, d.T_left_right};
  TrackSimulator simulator(world, config, d.rig.camera, right, stream_of(d.drive, NoiseStream::kPicture).bits());
  std::vector<std::vector<TrackObservation>> all;
  for (const std::int64_t t_us : d.drive.exposures) {
    all.push_back(simulator.observe(view_at(d.drive, d.rig.T_vehicle_left, t_us)));
  }
  return all;
}

void add_frames(TrackDrive& d, const TrackConfig& config) {
  const auto observed = observe_all(d, config);
  std::map<std::int64_t, std::size_t> right;  // stamp to exposure
  for (const Picture& p : d.drive.pictures_right) right[p.t_us] = p.exposure;
  for (const Picture& p : d.drive.pictures_left) {
    TrackFrame frame{p.t_us, d.drive.exposures[p.exposure], observed[p.exposure]};
    const auto pair = right.find(p.t_us);
    if (pair == right.end() || pair->second != p.exposure) {
      for (TrackObservation& o : frame.tracks) o.right.reset();
    }
    d.events.emplace_back(std::move(frame));
  }
}

}  // namespace

std::int64_t stamp_of(const DriveEvent& event) {
  return std::visit([](const auto& e) { return e.t_us; }, event);
}

TrackDrive make_track_drive(ScenarioConfig config, std::uint64_t seed, const TrackConfig& tracks) {
  if (config.camera.layout == CameraLayout::kNone) config.camera.layout = CameraLayout::kStereo;
  SimulatedDrive drive = simulate(config, seed);
  const SimulatedRig rig = rig_of(drive);
  TrackDrive d{std::move(drive), rig, nominal_T_vehicle_left(config.camera), T_left_right(config.camera), {}};
  for (const auto& s : d.drive.imu) d.events.emplace_back(s);
  for (const auto& s : d.drive.wheels) d.events.emplace_back(s);
  for (const auto& s : d.drive.mag) d.events.emplace_back(s);
  for (const auto& s : d.drive.gnss) d.events.emplace_back(s);
  add_frames(d, tracks);
  std::stable_sort(d.events.begin(), d.events.end(),
                   [](const DriveEvent& a, const DriveEvent& b) { return stamp_of(a) < stamp_of(b); });
  return d;
}

}  // namespace roadfix::test
