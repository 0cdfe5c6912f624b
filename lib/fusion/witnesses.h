/// Which channels agree: their motions over the last second and the last ten are compared in pairs (MODEL.md, section 5).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "fusion/pose_channel.h"

namespace roadfix {

/// One channel at an epoch.
struct Witness {
  bool comparable = false;
  int segment = 0;
  Planar track = Planar::Zero();  ///< sum of measured motions; of an INS: its pose
  // Of an INS alone:
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  double velocity_variance = 0.0;  ///< m2/s2
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.comparable, self.segment, self.track, self.P, self.velocity_variance);
  }
};

struct Epoch {
  int64_t t_us = 0;
  std::array<Witness, kFusionChannels> channels;
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.t_us, self.channels);
  }
};

/// A corrected motion, in the axes of its start.
struct WindowMotion : MotionStep {
  Eigen::Matrix3d S = Eigen::Matrix3d::Identity();  ///< its covariance; Q is what is new in the window
};

/// The pairs INS and vision, INS and wheels, vision and wheels.
inline constexpr int kPairs = 3;
enum class WitnessAgreement { kUnknown, kAgree, kContradict };

class Witnesses {
 public:
  explicit Witnesses(const AgreementConfig& config) : config_(config) {}

  /// Takes in an epoch, and compares.
  void add(const Epoch& epoch, const Channels& channels);

  [[nodiscard]] std::optional<int64_t> last_us() const;
  [[nodiscard]] WitnessAgreement agreement(FusionChannel a, FusionChannel b) const;
  /// Squared distances of the innovation and its variances, over the short window, for the record.
  struct Comparison {
    bool done = false;
    bool fits = false;  ///< within the gate, whatever the hysteresis says
    double nis = 0.0;
    Planar difference = Planar::Zero();
    Eigen::Matrix3d S = Eigen::Matrix3d::Zero();
    template <class Self, class Visitor>
    static void visit_members(Self& self, const Visitor& visit) {
      visit(self.done, self.fits, self.nis, self.difference, self.S);
    }
  };
  [[nodiscard]] const Comparison& comparison(FusionChannel a, FusionChannel b) const;
  /// Of one channel over the last `epochs` epochs; nothing where it was not there, or not of one segment, all the time.
  [[nodiscard]] std::optional<WindowMotion> window(FusionChannel c, int epochs, const Channels& channels) const;

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.history_, self.pairs_);
  }

  static constexpr double kSpacing = 0.5;  ///< s, between epochs
  static constexpr int kShort = 2;         ///< epochs: 1 s
  static constexpr int kLong = 20;         ///< epochs: 10 s
  static constexpr int kCalibration = 10;  ///< epochs: 5 s

 private:
  struct State {
    bool contradict = false;
    int count = 0;  ///< comparisons in a row for a change
    template <class Self, class Visitor>
    static void visit_members(Self& self, const Visitor& visit) {
      visit(self.contradict, self.count);
    }
  };
  struct Pair {
    std::array<State, 2> states;  ///< short and long window
    Comparison last;
    template <class Self, class Visitor>
    static void visit_members(Self& self, const Visitor& visit) {
      visit(self.states, self.last);
    }
  };
  void compare(Pair& pair, FusionChannel a, FusionChannel b, const Channels& channels);
  void judge(State& state, double nis) const;
  static int index(FusionChannel a, FusionChannel b) { return static_cast<int>(a) + static_cast<int>(b) - 1; }

  AgreementConfig config_;
  std::vector<Epoch> history_;  ///< oldest first, at most kLong + 1
  std::array<Pair, kPairs> pairs_;
};

}  // namespace roadfix
