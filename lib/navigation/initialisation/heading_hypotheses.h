/// Heading from nothing: one filter per heading around the circle, all given the same measurements and weighed by how
/// well they predict them (a Gaussian sum as PX4's EKFGSF_yaw, but of whole filters, so that the winner needs no second
/// start), (N.7.4). Hypotheses without weight are dropped.
#pragma once

#include <vector>

#include "navigation/filter.h"
#include "navigation/initialisation/start.h"

namespace roadfix::navigation {

class HeadingHypotheses {
 public:
  explicit HeadingHypotheses(const NavigationConfig& config) : config_(config) {}

  void start(const inertial::Earth& earth, const StartState& start);
  /// Goes on from a filter whose heading has become unsure and keeps all else that it knows, (N.7.8).
  void start(const Filter& unsure);
  void predict(const ImuSample& imu, double dt, const inertial::ImuNoise& noise);

  /// Every hypothesis tries aid(filter); weights follow. Returns the leader's record.
  template <class Aid>
  AidingRecord aid(const Aid& aid_one) {
    AidingRecord leading;
    for (size_t i = 0; i < filters_.size(); ++i) {
      const AidingRecord r = aid_one(filters_[i]);
      if (i == leader_) leading = r;
      weigh(i, r);
    }
    normalise();
    return leading;
  }

  [[nodiscard]] bool started() const { return !filters_.empty(); }
  [[nodiscard]] Filter& leader() { return filters_[leader_]; }
  [[nodiscard]] const Filter& leader() const { return filters_[leader_]; }
  /// One heading is left and known well.
  [[nodiscard]] bool confirmed() const;
  /// rad, of all hypotheses about the leader's vehicle heading, by their weights.
  [[nodiscard]] double heading_std() const;
  /// The leader with the covariance of the Gaussian sum about its mean.
  void merge_into(Filter& filter) const;
  void stop() { filters_.clear(); }

  template <class Archive>
  void serialise(Archive& a, const inertial::Earth& earth) {
    auto size = static_cast<int64_t>(filters_.size());
    a(size);
    if (size < 0 || size > 1000) throw std::runtime_error("state: impossible number of headings");
    while (static_cast<int64_t>(filters_.size()) < size) {
      filters_.emplace_back(config_, earth, false);
      log_weights_.push_back(0.0);
    }
    for (size_t i = 0; i < filters_.size(); ++i) {
      filters_[i].serialise(a);
      a(log_weights_[i]);
    }
    a(leader_);
  }

 private:
  void add_hypothesis(const inertial::Earth& earth, const StartState& start, double yaw, double yaw_std,
                      double log_weight);
  void weigh(size_t i, const AidingRecord& r);
  /// Log weight with how likely a car drives as the hypothesis says: forwards, unless it is slow.
  [[nodiscard]] double log_posterior(size_t i) const;
  [[nodiscard]] double share(size_t i) const;  // not normalised
  void normalise();

  NavigationConfig config_;
  std::vector<Filter> filters_;
  std::vector<double> log_weights_;
  size_t leader_ = 0;
};

/// What is known of the base block at a start, but for the camera.
BaseVector start_sigmas(const NavigationConfig& config, const StartState& start, double yaw_std);
/// rad, standard deviation of the vehicle's heading: the imu's and the mounting's errors together.
double vehicle_heading_std(const State& state);
/// rad, of the vehicle's x axis in the level frame.
double vehicle_yaw(const Mean& x);

}  // namespace roadfix::navigation
