/// When the monitor calls something wrong. One set for all vehicles; what a vehicle has is in Expectations.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace roadfix {

/// A verdict within a second of the fault, recovery within two of its end: every window below is short for that.
struct AlarmConfig {
  double raise_after = 0.1;  ///< s that a condition must hold before it counts
  double clear_after = 0.3;  ///< s that it must be gone before it is forgotten; what happened once holds for 1 s itself
};

struct ChannelLimits {
  double learn = 3.0;            ///< s of messages before a rate counts as known
  double silent_periods = 2.5;   ///< of the expected rate; a slow channel: silent_at_least after it was due
  double silent_at_least = 0.3;  ///< s; a shorter gap is no silence, however fast the channel
  double slow_share = 0.7;       ///< of the expected rate
  double fast_factor = 2.0;      ///< of the configured rate
  double lost_share = 0.05;      ///< of the messages of one second
  double latency = 0.25;         ///< s after the stamp; no shipped stage waits longer (docs/DESIGN.md, section 4)
  double ahead = 0.1;            ///< s before the stamp
  double stamp_jump = 0.5;       ///< s between the steps of stamps and clock
  double frozen_after = 0.5;     ///< s with one and the same content, and at least frozen_messages of them
  int frozen_messages = 5;
};

struct PoseLimits {
  double position_std_degraded = 1.5;  ///< m, horizontal, along the worst direction
  double position_std_unusable = 5.0;  ///< m
  double yaw_std_degraded_deg = 3.0;
  double yaw_std_unusable_deg = 10.0;
  double jump = 1.0;  ///< m beside what the velocity explains
};

struct ConsistencyLimits {
  double window = 2.0;         ///< s of measurements that a NIS is averaged over; slow sources: their last five
  double nis_ratio = 5.0;      ///< of mean NIS to degrees of freedom
  double refused_share = 0.5;  ///< of the measurements in the window
  double apart = 1.5;          ///< m that two absolute poses may be apart, whatever their covariances
  double apart_sigmas = 5.0;   ///< beyond which they contradict each other
  double motion = 0.75;        ///< m by which two motions over the window may differ
  double motion_share = 0.1;   ///< of the distance, on top
};

struct ProcessLimits {
  double heartbeat = 2.5;  ///< s without a heartbeat; 2.5 of its intervals where a process beats faster
  double cpu_share = 0.9;  ///< of one core
  double memory_mib = 4096.0;
  double queue_age = 0.5;   ///< s that an input may wait for its handler
  double disk_gib = 2.0;    ///< free
  double clock_step = 0.5;  ///< s between the computer's clock and the stack's
};

struct HealthConfig {
  double start_grace = 3.0;  ///< s for what is expected to appear
  AlarmConfig alarm;
  ChannelLimits channel;
  PoseLimits pose;
  ConsistencyLimits consistency;
  ProcessLimits process;
};

/// What this vehicle should have; what is not given is learnt.
struct ExpectedChannel {
  std::string name;
  std::optional<double> rate;  ///< Hz
};

struct Expectations {
  std::vector<ExpectedChannel> channels;
  std::vector<std::string> processes;
  std::vector<std::string> several = {"monitor"};  ///< may run more than once side by side: who only looks
  /// The estimate that the verdict is about: the first of these that was ever received.
  std::vector<std::string> judged_poses = {"POSE_FUSED", "POSE_INS"};
};

template <class Visitor>
void visit(AlarmConfig& c, Visitor& v) {
  v.number("raise_after_s", c.raise_after, 0.0, 10.0);
  v.number("clear_after_s", c.clear_after, 0.0, 60.0);
}

template <class Visitor>
void visit(ChannelLimits& c, Visitor& v) {
  v.number("learn_s", c.learn, 0.5, 60.0);
  v.number("silent_periods", c.silent_periods, 1.1, 100.0);
  v.number("silent_at_least_s", c.silent_at_least, 0.01, 60.0);
  v.number("slow_share", c.slow_share, 0.0, 1.0);
  v.number("fast_factor", c.fast_factor, 1.1, 1e6);
  v.number("lost_share", c.lost_share, 0.0, 1.0);
  v.number("latency_s", c.latency, 0.001, 60.0);
  v.number("ahead_s", c.ahead, 0.001, 60.0);
  v.number("stamp_jump_s", c.stamp_jump, 0.01, 3600.0);
  v.number("frozen_after_s", c.frozen_after, 0.01, 60.0);
  v.integer("frozen_messages", c.frozen_messages, 2, 1000);
}

template <class Visitor>
void visit(PoseLimits& c, Visitor& v) {
  v.number("position_std_degraded_m", c.position_std_degraded, 0.001, 1e4);
  v.number("position_std_unusable_m", c.position_std_unusable, 0.001, 1e4);
  v.number("yaw_std_degraded_deg", c.yaw_std_degraded_deg, 0.001, 180.0);
  v.number("yaw_std_unusable_deg", c.yaw_std_unusable_deg, 0.001, 180.0);
  v.number("jump_m", c.jump, 0.01, 1e4);
}

template <class Visitor>
void visit(ConsistencyLimits& c, Visitor& v) {
  v.number("window_s", c.window, 0.5, 10.0);
  v.number("nis_ratio", c.nis_ratio, 1.0, 1e3);
  v.number("refused_share", c.refused_share, 0.0, 1.0);
  v.number("apart_m", c.apart, 0.0, 1e4);
  v.number("apart_sigmas", c.apart_sigmas, 1.0, 100.0);
  v.number("motion_m", c.motion, 0.0, 1e4);
  v.number("motion_share", c.motion_share, 0.0, 1.0);
}

template <class Visitor>
void visit(ProcessLimits& c, Visitor& v) {
  v.number("heartbeat_s", c.heartbeat, 1.1, 60.0);
  v.number("cpu_share", c.cpu_share, 0.01, 256.0);
  v.number("memory_mib", c.memory_mib, 1.0, 1e7);
  v.number("queue_age_s", c.queue_age, 0.001, 60.0);
  v.number("disk_gib", c.disk_gib, 0.0, 1e6);
  v.number("clock_step_s", c.clock_step, 0.001, 3600.0);
}

template <class Visitor>
void visit(HealthConfig& c, Visitor& v) {
  v.number("start_grace_s", c.start_grace, 0.5, 600.0);
  v.group("alarm", c.alarm);
  v.group("channel", c.channel);
  v.group("pose", c.pose);
  v.group("consistency", c.consistency);
  v.group("process", c.process);
}

}  // namespace roadfix
