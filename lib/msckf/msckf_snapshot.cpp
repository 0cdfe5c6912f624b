// Snapshots: one list of members serves writing and reading.
#include <stdexcept>

#include "msckf/msckf.h"
#include "stream/state_bytes.h"

namespace roadfix {

using namespace msckf;

namespace {

constexpr size_t kMost = 1'000'000;

/// The number of things, then each.
template <class Archive, class List, class Each>
void list(Archive& a, List& items, size_t most, const Each& each) {
  auto count = static_cast<int64_t>(items.size());
  a(count);
  if (count < 0 || static_cast<size_t>(count) > most) throw std::runtime_error("state: impossible number of items");
  if constexpr (Archive::kReads) items.resize(static_cast<size_t>(count));
  for (auto& item : items) each(item);
}

template <class Archive, class T, class Each>
void optional(Archive& a, std::optional<T>& value, const Each& each) {
  bool present = value.has_value();
  a(present);
  if constexpr (Archive::kReads) {
    value.reset();
    if (present) value.emplace();
  }
  if (value) each(*value);
}

template <class Archive>
void point(Archive& a, SeenPoint& p) {
  a(p.track, p.left, p.px);
  optional(a, p.right, [&](Eigen::Vector2d& right) { a(right); });
}

template <class Archive>
void frame(Archive& a, SeenFrame& f) {
  a(f.t_us);
  list(a, f.points, kMost, [&](SeenPoint& p) { point(a, p); });
}

template <class Archive>
void imu_sample(Archive& a, ImuSample& s) {
  a(s.t_us, s.gyro, s.accel);
}

template <class Archive>
void calibrated(Archive& a, Calibrated& c) {
  a(c.T_imu_camera.q.coeffs(), c.T_imu_camera.p, c.lens, c.time_offset, c.wheel_scale, c.mounting, c.p_imu_axle);
}

}  // namespace

template <class Archive>
void State::serialise(Archive& a) {
  a(imu.t_us, imu.q.coeffs(), imu.v, imu.p, imu.gyro_bias, imu.accel_bias, imu.gyro_scale, imu.accel_scale);
  calibrated(a, camera);
  list(a, clones, kMaxClones, [&](Clone& c) { a(c.id, c.at, c.R, c.p); });
  list(a, landmarks, kMaxLandmarks, [&](Landmark& l) { a(l.track, l.anchor, l.at, l.f); });
  a(size_);
  const auto expected = static_cast<size_t>(kBaseSize) + 6 * clones.size() + 3 * landmarks.size();
  if (size_ < 0 || static_cast<size_t>(size_) != expected) throw std::runtime_error("state: impossible size");
  Eigen::MatrixXd P = P_.topLeftCorner(size_, size_);
  a(P);
  P_.topLeftCorner(size_, size_) = P;
}

template <class Archive>
void TrackStore::serialise(Archive& a) {
  list(a, tracks_, kMost, [&](Track& t) {
    a(t.id, t.alive, t.count);
    if (t.count < 0 || t.count > kMaxClones) throw std::runtime_error("state: impossible number of sightings");
    for (int i = 0; i < t.count; ++i) {
      Sighting& s = t.seen[static_cast<size_t>(i)];
      a(s.clone);
      point(a, s.point);
    }
  });
}

template <class Archive>
void Standing::serialise(Archive& a) {
  a(sums_, times_, block_.end_us, block_.gyro, block_.accel, block_.gyro_wander, block_.accel_wander);
  for (Picture* picture : {&older_, &newer_, &last_, &before_}) {
    a(picture->t_us);
    list(a, picture->places, kMost, [&](Place& p) { a(p.track, p.left); });
  }
  optional(a, flow_, [&](double& flow) { a(flow); });
  a(num_flow_, noise_, frame_us_, wheels_us_, wheels_rest_);
}

template <class Archive>
void ClockSearch::serialise(Archive& a) {
  a(searching_, sigma_, until_search_);
  frame(a, last_);
  list(a, angles_, kMost, [&](Angle& angle) { a(angle.t_us, angle.angle); });
  list(a, turns_, kMost, [&](Turn& turn) { a(turn.from_us, turn.to_us, turn.rate); });
}

template <class Archive>
void Msckf::serialise(Archive& a) {
  state_.serialise(a);
  tracks_.serialise(a);
  standing_.serialise(a);
  clock_.serialise(a);
  list(a, imu_, kMost, [&](ImuSample& s) { imu_sample(a, s); });
  for (std::deque<SeenFrame>* frames : {&frames_, &past_}) list(a, *frames, kMost, [&](SeenFrame& f) { frame(a, f); });
  a(next_past_us_);
  list(a, wheels_, kMost, [&](WheelSample& w) {
    a(w.t_us, w.direction, w.num_speeds);
    for (double& speed : w.speeds) a(speed);
    optional(a, w.yaw_rate, [&](double& rate) { a(rate); });
  });
  for (std::optional<KnownSpeed>* speed : {&known_speed_, &wheel_speed_})
    optional(a, *speed, [&](KnownSpeed& s) { a(s.t_us, s.speed, s.sigma, s.from); });
  optional(a, planned_, [&](MovingStart& s) {
    a(s.t_us, s.length_us, s.at.up, s.at.v, s.at.gyro_bias, s.at.accel_bias, s.cov_v, s.tilt_std, s.scale);
    calibrated(a, s.at.camera);
  });
  frame(a, watched_);
  optional(a, by_eyes_, [&](KnownVelocity& s) { a(s.t_us, s.v, s.cov); });
  a(phase_, scale_, reason_, stands_, reset_counter_, reset_delta_.q.coeffs(), reset_delta_.p, last_pose_.q.coeffs(),
    last_pose_.p, next_clone_, clone_us_, next_wheels_us_, next_sideslip_us_, next_planar_us_, next_zero_us_,
    stands_since_us_, zero_us_, begun_gyro_bias_, used_us_, doubtful_us_, used_share_, num_seen_);
  stamps_.serialise(a);
}

std::vector<uint8_t> Msckf::save() const {
  StateArchiveOut writer;
  // The writer only reads: serialise() is one list for both directions and so cannot be const.
  const_cast<Msckf*>(this)->serialise(writer);
  return writer.out.take();
}

void Msckf::load(std::span<const uint8_t> bytes) {
  Msckf fresh(config_);
  StateArchiveIn reader{StateReader(bytes)};
  fresh.serialise(reader);
  reader.in.finish();
  *this = std::move(fresh);
}

}  // namespace roadfix
