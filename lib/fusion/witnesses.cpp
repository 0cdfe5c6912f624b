#include "fusion/witnesses.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kBorrowedLengths = 0.05;   ///< relative: wheels that slip, or a tyre that lost air
constexpr double kPlaceCorrelation = 10.0;  ///< s: half of the time for which a filter's place has the same error

/// Of a filter's motion between two of its poses: what its velocity may have wrong, what it corrected, and what its
/// place loses of its error meanwhile; not more than if the two poses had nothing in common (F.5.1).
Eigen::Matrix3d ins_noise(const Witness& from, const Witness& to, const Planar& motion, double dt) {
  const double forgotten = std::min(1.0, dt / kPlaceCorrelation);
  Eigen::Matrix3d P;
  for (int i = 0; i < 3; ++i) {
    const double velocity = std::max(from.velocity_variance, to.velocity_variance);
    const double led = i < 2 ? velocity * dt * dt : std::max(0.0, to.P(i, i) - from.P(i, i));
    const double lasting = led + std::max(0.0, from.P(i, i) - to.P(i, i)) + forgotten * from.P(i, i);
    P.row(i).setZero();
    P(i, i) = std::min(from.P(i, i) + to.P(i, i), lasting);
  }
  const double c = std::cos(from.track.z()), s = std::sin(from.track.z());
  Eigen::Matrix3d S = turned(P, c, -s);
  const Eigen::Vector2d across(-motion.y(), motion.x());
  S.topLeftCorner<2, 2>() += from.P(2, 2) * across * across.transpose();
  return S;
}

}  // namespace

std::optional<int64_t> Witnesses::last_us() const {
  if (history_.empty()) return std::nullopt;
  return history_.back().t_us;
}

void Witnesses::add(const Epoch& epoch, const Channels& channels) {
  if (history_.size() > static_cast<std::size_t>(kLong)) history_.erase(history_.begin());
  history_.push_back(epoch);
  for (const auto& [a, b] :
       {std::pair(FusionChannel::kIns, FusionChannel::kVo), std::pair(FusionChannel::kIns, FusionChannel::kWheel),
        std::pair(FusionChannel::kVo, FusionChannel::kWheel)})
    compare(pairs_[static_cast<std::size_t>(index(a, b))], a, b, channels);
}

std::optional<WindowMotion> Witnesses::window(FusionChannel c, int epochs, const Channels& channels) const {
  const auto n = static_cast<int>(history_.size());
  if (n <= epochs) return std::nullopt;
  const auto i = static_cast<std::size_t>(c);
  const Epoch &first = history_[static_cast<std::size_t>(n - 1 - epochs)], &last = history_.back();
  for (int k = n - 1 - epochs; k < n; ++k) {
    const Witness& w = history_[static_cast<std::size_t>(k)].channels[i];
    if (!w.comparable || w.segment != last.channels[i].segment) return std::nullopt;
  }
  WindowMotion m;
  m.dt = seconds_between(first.t_us, last.t_us);
  const Witness &from = first.channels[i], &to = last.channels[i];
  const Planar measured = motion_between(from.track, to.track);
  if (c == FusionChannel::kIns) {
    m.motion = measured;
    m.S = ins_noise(from, to, measured, m.dt);
    return m;
  }
  const MotionStep step = channels[i].calibration().corrected(measured, m.dt);
  m.motion = step.motion;
  m.by_calibration = step.by_calibration;
  m.Q = channels[i].errors().of_window(step.motion, m.dt);
  m.S = m.covariance(channels[i].calibration().covariance());
  return m;
}

void Witnesses::compare(Pair& pair, FusionChannel a, FusionChannel b, const Channels& channels) {
  pair.last = {};
  const int lengths[] = {kShort, kLong};
  const bool metric =
      channels[static_cast<std::size_t>(a)].has_lengths() && channels[static_cast<std::size_t>(b)].has_lengths();
  for (std::size_t i = 0; i < 2; ++i) {
    const auto of_a = window(a, lengths[i], channels), of_b = window(b, lengths[i], channels);
    if (!of_a || !of_b || !metric) {
      pair.states[i] = {};
      continue;
    }
    const Planar d = difference_of(of_b->motion, of_a->motion);
    Eigen::Matrix3d S = of_a->S + of_b->S;
    if (a == FusionChannel::kIns && channels[static_cast<std::size_t>(b)].newest().lengths_of_wheels) {
      // Vision has its lengths from the wheels: it is no second witness of the way's length.
      const Eigen::Vector2d borrowed = kBorrowedLengths * of_b->motion.head<2>();
      S.topLeftCorner<2, 2>() += borrowed * borrowed.transpose();
    }
    const double nis = d.dot(S.ldlt().solve(d));
    judge(pair.states[i], nis);
    if (i == 0)
      pair.last = {true, nis < config_.gate, nis, d, S};
    else
      pair.last.fits = pair.last.fits && nis < config_.gate;
  }
}

void Witnesses::judge(State& state, double nis) const {
  if (nis > config_.gross) {
    state = {true, 0};
    return;
  }
  const bool against = state.contradict ? nis < config_.clear : nis > config_.gate;
  state.count = against ? state.count + 1 : 0;
  if (state.count < (state.contradict ? config_.good_after : config_.bad_after)) return;
  state = {!state.contradict, 0};
}

WitnessAgreement Witnesses::agreement(FusionChannel a, FusionChannel b) const {
  const Pair& pair = pairs_[static_cast<std::size_t>(index(a, b))];
  if (!pair.last.done) return WitnessAgreement::kUnknown;
  return pair.states[0].contradict || pair.states[1].contradict ? WitnessAgreement::kContradict
                                                                : WitnessAgreement::kAgree;
}

const Witnesses::Comparison& Witnesses::comparison(FusionChannel a, FusionChannel b) const {
  return pairs_[static_cast<std::size_t>(index(a, b))].last;
}

}  // namespace roadfix
